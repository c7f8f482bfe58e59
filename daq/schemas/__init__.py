"""What leaves the program as JSON, over REST and from the command line alike; every field's name carries its unit."""

from daq.schemas.agreement import AgreementDocument, agreement_document
from daq.schemas.document import Document
from daq.schemas.live import LiveDocument, live_document
from daq.schemas.picture import PictureDocument, picture_document
from daq.schemas.run import RunDocument, RunListDocument, run_document, run_list_document
from daq.schemas.summary import SummaryDocument, summary_document
from daq.service.schemas.health import HealthDocument, health_document
from daq.service.schemas.problem import Fault, ProblemDocument
from daq.service.schemas.stopping import OrderDocument, StartedDocument, StopDocument, StoppingDocument

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
