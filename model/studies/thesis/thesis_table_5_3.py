"""Table 5.3 of the thesis as printed, and why some of its entries cannot be meant."""

from typing import Final

# rad/s: third, second, first bending, upper, lower rigid mode, Hz; forward, then reverse
PRINTED: Final[dict[int, tuple[tuple[int, ...], tuple[int, ...]]]] = {
    0: ((11976, 5046, 1732, 52, 20), (-11976, -5046, -1732, -52, -20)),
    500: ((11997, 5094, 1769, 53, 25), (-11955, -4997, -1695, -52, -16)),
    1000: ((12019, 5143, 1808, 53, 31), (-11934, -4950, -1659, -52, -13)),
    1500: ((12040, 5193, 1847, 53, 37), (-11913, -4904, -1623, -52, -11)),
    2000: ((12063, 5244, 1887, 53, 44), (-11893, -4858, -1589, -52, -9)),
    2500: ((12085, 5295, 1927, 53, 55), (-11873, -4813, -1555, -50, -8)),
    3000: ((12108, 5347, 1968, 53, 61), (-11853, -4769, -1521, -50, -7)),
    3500: ((12131, 5400, 2010, 53, 68), (-11833, -4725, -1489, -50, -6)),
    4000: ((12154, 5454, 2052, 53, 76), (-11814, -4682, -1457, -50, -5)),
    4500: ((12177, 5508, 2095, 53, 85), (-11794, -4640, -1427, -50, -5)),
    5000: ((12201, 5563, 2138, 53, 93), (-11775, -4598, -1396, -50, -4)),
    5500: ((12225, 5619, 2182, 53, 101), (-11756, -4557, -1367, -50, -4)),
    6000: ((12250, 5676, 2227, 53, 110), (-11738, -4517, -1338, -50, -4)),
    6500: ((12274, 5733, 2272, 53, 118), (-11720, -4477, -1311, -50, -4)),
    7000: ((12300, 5791, 2317, 53, 127), (-11701, -4438, -1283, -50, -3)),
    7500: ((12325, 5850, 2363, 53, 135), (-11683, -4399, -1257, -50, -3)),
    8000: ((12351, 5909, 2410, 53, 143), (-11667, -4361, -1231, -50, -3)),
}

CARRIED_ON: Final = (
    "printed as 53 at every speed; the branch dips to 50.0 where it meets the lower one near 2,600 rad/s"
)
HAND_CARRIED: Final = "printed as -50 from 2,500 rad/s on; the branch hardly depends on speed and stays at -52.4"
JUMPS: Final = "the column falls by 18 a row; -11665.6 continues it, -11667 does not"


def reason(speed: int, printed: int) -> str:
    """Return why an entry is not met; empty where nothing is known."""
    if printed == 53 and 2500 <= speed <= 6500:
        return CARRIED_ON
    if printed == -50 and speed >= 2500:
        return HAND_CARRIED
    return JUMPS if (speed, printed) == (8000, -11667) else ""
