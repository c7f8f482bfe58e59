"""Reader for nested TOML tables of physical quantities that collects all faults.

The key of a quantity ends with its unit, as in ``radius_mm`` or ``mass_kg``; any unit of its dimension is accepted.
A fault names quantity, value, unit and what was expected.
"""

import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from model.errors import ParameterError

DIMENSIONS: Final[dict[str, dict[str, float]]] = {
    "length": {"mm": 1e-3, "m": 1.0, "um": 1e-6},
    "radius": {"mm": 1e-3, "m": 1.0, "um": 1e-6},
    "mass": {"kg": 1.0, "g": 1e-3},
    "moment of inertia": {"kg_m2": 1.0, "kg_mm2": 1e-6, "g_mm2": 1e-9},
    "modulus": {"gpa": 1e9, "mpa": 1e6, "pa": 1.0},
    "density": {"kg_m3": 1.0, "g_cm3": 1e3},
    "viscosity": {"pa_s": 1.0, "mpa_s": 1e-3, "cp": 1e-3},
    "stiffness": {"n_m": 1.0, "n_mm": 1e3, "n_um": 1e6},
    "damping": {"n_s_m": 1.0, "n_s_mm": 1e3},
    "contact damping": {"s_m": 1.0},
    "imbalance": {"kg_m": 1.0, "g_mm": 1e-6},
    "angle": {"deg": math.pi / 180, "rad": 1.0},
    "force": {"n": 1.0, "kn": 1e3},
    "acceleration": {"m_s2": 1.0},
    "number": {"": 1.0},
}
PLAUSIBLE_RANGES: Final[dict[str, tuple[float, float]]] = {
    "length": (1e-9, 1e2), "radius": (1e-5, 1e1), "mass": (1e-9, 1e6), "moment of inertia": (1e-15, 1e6),
    "modulus": (1e6, 1e13), "density": (1e-3, 1e5), "viscosity": (1e-7, 1e3), "stiffness": (1e-3, 1e13),
    "damping": (1e-9, 1e9), "contact damping": (1e-9, 1e6), "imbalance": (1e-15, 1e3), "angle": (0.0, 1e4),
    "force": (1e-12, 1e7), "acceleration": (1e-9, 1e5), "number": (0.0, 1e3),
}  # fmt: skip
"""Plausible sizes in SI units (0 is always allowed): a value outside is a typing error or loses precision."""
UNIT_LABELS: Final[dict[str, str]] = {
    "um": "µm", "kg_m2": "kg m²", "kg_mm2": "kg mm²", "g_mm2": "g mm²", "gpa": "GPa", "mpa": "MPa", "pa": "Pa",
    "kg_m3": "kg/m³", "g_cm3": "g/cm³", "pa_s": "Pa s", "mpa_s": "mPa s", "cp": "cP", "n_m": "N/m", "n_mm": "N/mm",
    "n_um": "N/µm", "n_s_m": "N s/m", "n_s_mm": "N s/mm", "kg_m": "kg m", "g_mm": "g mm", "deg": "°", "n": "N",
    "kn": "kN", "m_s2": "m/s²", "s_m": "s/m",
}  # fmt: skip
MAX_NUMBER: Final = 1e300
Limit = str  # "positive", "not negative" or "any"


class TableError(ParameterError):
    """A table has faults.

    Parameters
    ----------
    faults : sequence of str
        All faults found.
    """

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__("; ".join(faults))
        self.faults = tuple(faults)

    def __reduce__(self) -> tuple[type["TableError"], tuple[tuple[str, ...]]]:
        """Return the arguments for pickling: errors are passed between processes."""
        return type(self), (self.faults,)


class Table:
    """One table of a TOML file.

    Parameters
    ----------
    data : mapping
        Content of the table.
    name : str
        Path of the table, such as "segment[2]"; empty for the root.
    faults : list of str
        List to which faults are added. An invalid value is replaced by a harmless one, so that the rest can be
        checked.
    """

    def __init__(self, data: Mapping[str, object], name: str, faults: list[str]) -> None:
        self._data, self._name, self._faults = data, name, faults
        self._expected_keys: list[str] = []
        self._used_keys: set[str] = set()

    def has(self, name: str) -> bool:
        """Return whether the table has this key, or a quantity of this name in any unit."""
        return any(key == name or key.startswith(f"{name}_") for key in self._data)

    def number(self, name: str, dimension: str, default: float | None = None, limit: Limit = "positive") -> float:
        """Return a quantity in SI units, or the default, in SI units, if it is missing."""
        found = self._quantity(name, dimension, required=default is None)
        if found is None:
            return 1.0 if default is None else default
        return self._scaled(found, self._data[found.key], limit)

    def numbers(self, name: str, dimension: str, default: tuple[float, float]) -> tuple[float, float]:
        """Return two quantities in SI units."""
        found = self._quantity(name, dimension, required=False)
        if found is None:
            return default
        values = self._data[found.key]
        if not isinstance(values, list) or len(values) != 2:
            self.fault(f"{found.key} = {values}: expected two numbers")
            return default
        first, second = (self._scaled(found, value, "any") for value in values)
        return first, second

    def matrix(self, name: str, dimension: str, *, required: bool) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return a 2 by 2 matrix in SI units, given as matrix or as one isotropic value; zeros if missing."""
        found = self._quantity(name, dimension, required=required)
        if found is None:
            return (0.0, 0.0), (0.0, 0.0)
        value = self._data[found.key]
        if isinstance(value, list):
            rows = [row for row in value if isinstance(row, list) and len(row) == 2]
            if len(value) != 2 or len(rows) != 2:
                self.fault(f"{found.key} = {value}: expected a number or two rows of two numbers")
                return (0.0, 0.0), (0.0, 0.0)
            (xx, xy), (yx, yy) = ([self._scaled(found, one, "any") for one in row] for row in rows)
            return (xx, xy), (yx, yy)
        same = self._scaled(found, value, "positive" if required else "not negative")
        return (same, 0.0), (0.0, same)

    def integer(self, name: str, default: int | None = None) -> int:
        """Return a whole number."""
        self._expected_keys.append(name)
        if name not in self._data:
            if default is None:
                self.fault(f"{name}: missing, expected a whole number")
            return 1 if default is None else default
        self._used_keys.add(name)
        value = self._data[name]
        if isinstance(value, bool) or not isinstance(value, int):
            self.fault(f"{name} = {value}: expected a whole number")
            return 1
        return value

    def text(self, name: str, default: str, choices: Sequence[str] = ()) -> str:
        """Return a string; if choices are given, one of them."""
        self._expected_keys.append(name)
        value = self._data.get(name, default)
        self._used_keys.add(name)
        if not isinstance(value, str) or (choices and value not in choices):
            expected = " or ".join(f'"{choice}"' for choice in choices) if choices else "a text in quotes"
            self.fault(f'{name} = "{value}": expected {expected}')
            return default
        return value

    def table(self, name: str, *, required: bool = True) -> "Table | None":
        """Return a table nested in this one; None if it is missing."""
        self._expected_keys.append(name)
        self._used_keys.add(name)
        value = self._data.get(name)
        if isinstance(value, Mapping):
            return Table(value, self._path(name), self._faults)
        if value is not None or required:
            self.fault(f"{name}: {'missing' if value is None else value}, expected a table [{self._path(name)}]")
        return None

    def tables(self, name: str) -> list["Table"]:
        """Return the nested tables of an array; an empty list if it is missing."""
        self._expected_keys.append(name)
        self._used_keys.add(name)
        value = self._data.get(name, [])
        if not isinstance(value, list) or not all(isinstance(one, Mapping) for one in value):
            self.fault(f"{name} = {value}: expected tables [[{self._path(name)}]]")
            return []
        return [Table(one, f"{self._path(name)}[{number}]", self._faults) for number, one in enumerate(value)]

    def report_unknown_keys(self) -> None:
        """Add a fault for every key that was not read."""
        for key in self._data:
            if key not in self._used_keys:
                near = difflib.get_close_matches(key, self._expected_keys, n=1, cutoff=0.5)
                hint = f"did you mean {near[0]}?" if near else f"expected one of {', '.join(self._expected_keys)}"
                self.fault(f"{key} = {self._data[key]}: unknown key, {hint}")

    def fault(self, text: str) -> None:
        """Add a fault of this table."""
        self._faults.append(self._path(text))

    def _path(self, key: str) -> str:
        return f"{self._name}.{key}" if self._name else key

    def _quantity(self, name: str, dimension: str, *, required: bool) -> "_Quantity | None":
        """Return key and unit of a quantity; None if it is missing."""
        units = DIMENSIONS[dimension]
        keys = {f"{name}_{unit}" if unit else name: unit for unit in units}
        usual = next(iter(keys))
        self._expected_keys.append(usual)
        present = [key for key in keys if key in self._data]
        self._used_keys.update(present)
        if len(present) > 1:
            self.fault(f"{present[1]} = {self._data[present[1]]}: expected one key only, {present[0]} is given already")
        if present:
            unit = keys[present[0]]
            return _Quantity(present[0], UNIT_LABELS.get(unit, unit), units[unit], PLAUSIBLE_RANGES[dimension])
        foreign = [key for key in self._data if key not in self._used_keys and self._is_unit_of(key, name)]
        for key in foreign[:1]:
            self._used_keys.add(key)
            unit = key.removeprefix(name).removeprefix("_") or "none"
            self.fault(f"{key} = {self._data[key]}: unknown unit {unit}, expected {' or '.join(keys)}")
        if required and not foreign:
            self.fault(f"{usual}: missing, expected a {dimension}")
        return None

    @staticmethod
    def _is_unit_of(key: str, name: str) -> bool:
        """Return whether a key names this quantity, with any unit or none."""
        return key == name or key.startswith(f"{name}_")

    def _scaled(self, quantity: "_Quantity", value: object, limit: Limit) -> float:
        key, unit, factor = quantity.key, quantity.unit, quantity.factor
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.fault(f"{key} = {value}: expected a number")
            return 1.0
        shown = (
            f"{value:g} {unit}".rstrip() if abs(value) < MAX_NUMBER or not isinstance(value, int) else "too many digits"
        )
        bound = {"positive": "above 0", "not negative": "0 or more", "any": ""}[limit]
        is_finite = -MAX_NUMBER < value < MAX_NUMBER  # also false for NaN
        if not is_finite or (limit == "positive" and value <= 0) or (limit == "not negative" and value < 0):
            self.fault(f"{key} = {shown}: expected a finite value {bound}".rstrip())
            return 1.0
        lowest, highest = quantity.range
        if value and not lowest <= abs(value * factor) <= highest:
            self.fault(f"{key} = {shown}: expected {lowest / factor:g} to {highest / factor:g} {unit} in size".rstrip())
            return float(value * factor)
        if unit != UNIT_LABELS["deg"]:
            return float(f"{value * factor:.15g}")  # 20 µm is 2e-5 m, not 1.9999999999999998e-05
        return value * factor


@dataclass(frozen=True, slots=True)
class _Quantity:
    """Key of a quantity, label of its unit, factor to SI units, and plausible range in SI units."""

    key: str
    unit: str
    factor: float
    range: tuple[float, float]
