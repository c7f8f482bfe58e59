"""What leaves the program as JSON, over REST and from the command line alike; every field's name carries its unit."""

from daq.service.documents.agreement import AgreementDocument, agreement_document
from daq.service.documents.document import Document
from daq.service.documents.health import HealthDocument, health_document
from daq.service.documents.live import LiveDocument, live_document
from daq.service.documents.picture import PictureDocument, picture_document
from daq.service.documents.problem import Fault, ProblemDocument
from daq.service.documents.run import RunDocument, RunListDocument, run_document, run_list_document
from daq.service.documents.stopping import OrderDocument, StartedDocument, StopDocument, StoppingDocument
from daq.service.documents.summary import SummaryDocument, summary_document

__all__ = [
    "AgreementDocument",
    "Document",
    "Fault",
    "HealthDocument",
    "LiveDocument",
    "OrderDocument",
    "PictureDocument",
    "ProblemDocument",
    "RunDocument",
    "RunListDocument",
    "StartedDocument",
    "StopDocument",
    "StoppingDocument",
    "SummaryDocument",
    "agreement_document",
    "health_document",
    "live_document",
    "picture_document",
    "run_document",
    "run_list_document",
    "summary_document",
]
