"""A part of a JSON document that is read key by key, so that a fault can be named."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Self, TypeVar

from recordings.errors import DamagedError

Choice = TypeVar("Choice", bound=StrEnum)


@dataclass(frozen=True, slots=True)
class Section:
    """A group of values and where it stands; what is missing or of another kind is a DamagedError.

    Parameters
    ----------
    where : str
        Its place, as "header.acquisition".
    values : mapping of str to object
        What it holds.
    """

    where: str
    values: Any

    def __post_init__(self) -> None:
        if not isinstance(self.values, Mapping):
            raise DamagedError(f"{self.where}: {self.values!r}, expected a group of values")

    def has(self, key: str) -> bool:
        """Whether there is such a key."""
        return key in self.values

    def is_null(self, key: str) -> bool:
        """Whether the value is given as none."""
        return self._get(key) is None

    def section(self, key: str) -> Self:
        """Return the group of this key."""
        return type(self)(f"{self.where}.{key}", self._get(key))

    def sections(self, key: str) -> list[Self]:
        """Return the groups of a list."""
        return [type(self)(f"{self.where}.{key}[{k}]", value) for k, value in enumerate(self._list(key))]

    def text(self, key: str) -> str:
        """Return a text."""
        value = self._get(key)
        if not isinstance(value, str):
            raise self._wrong(key, value, "a text")
        return value

    def flag(self, key: str) -> bool:
        """Return true or false."""
        value = self._get(key)
        if not isinstance(value, bool):
            raise self._wrong(key, value, "true or false")
        return value

    def whole(self, key: str) -> int:
        """Return a whole number."""
        value = self._get(key)
        if not isinstance(value, int) or isinstance(value, bool):
            raise self._wrong(key, value, "a whole number")
        return value

    def number(self, key: str) -> float:
        """Return a number."""
        return self._number(key, self._get(key))

    def numbers(self, key: str) -> tuple[float, ...]:
        """Return the numbers of a list."""
        return tuple(self._number(key, value) for value in self._list(key))

    def choice(self, key: str, kind: type[Choice]) -> Choice:
        """Return one of a kind's values."""
        value = self.text(key)
        try:
            return kind(value)
        except ValueError:
            raise self._wrong(key, value, "one of " + ", ".join(kind)) from None

    def _get(self, key: str) -> Any:
        if key not in self.values:
            raise DamagedError(f"{self.where}: {key} is missing")
        return self.values[key]

    def _list(self, key: str) -> list[Any]:
        value = self._get(key)
        if not isinstance(value, list):
            raise self._wrong(key, value, "a list")
        return value

    def _number(self, key: str, value: Any) -> float:
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise self._wrong(key, value, "a number")
        return float(value)

    def _wrong(self, key: str, value: Any, expected: str) -> DamagedError:
        return DamagedError(f"{self.where}.{key}: {value!r}, expected {expected}")
