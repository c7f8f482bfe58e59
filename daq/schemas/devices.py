"""What is connected."""

from pydantic import Field

from daq.drivers.ni import FoundDevice
from daq.schemas.document import Document


class FoundDeviceDocument(Document):
    """A device that the driver lists."""

    name: str = Field(description="The driver's name for it, which moves with the port", examples=["Dev1"])
    product: str = Field(description="Product name as the device gives it", examples=["USB-6251"])
    serial: str = Field(description="Serial number as printed on it", examples=["1A2B3C"])
    simulated: bool = Field(description="Whether the driver only simulates it")
    busy: bool | None = Field(description="Whether another acquisition holds it; null where it cannot be asked")
    driver: str = Field(description="Name and version of the driver, and where it is", examples=["NI-DAQmx 24.5.1"])


def found_device_document(device: FoundDevice) -> FoundDeviceDocument:
    """Return a device as a document."""
    return FoundDeviceDocument(
        name=device.name,
        product=device.product,
        serial=device.serial,
        simulated=device.simulated,
        busy=device.busy,
        driver=device.driver,
    )
