"""The error of the stand-in driver."""


class DriverError(Exception):
    def __init__(self, code: int) -> None:
        super().__init__(f"the driver's text of {code},\nover two lines")
        self.code = code
