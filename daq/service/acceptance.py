"""What a client accepts: codings and media types, with their weights (RFC 9110, 12.5)."""

from collections.abc import Mapping


def accepts_gzip(header: str | None) -> bool:
    """Return whether a header Accept-Encoding allows gzip by name or by a star."""
    weights = _weights(header or "")
    return weights.get("gzip", weights.get("*", 0.0)) > 0.0


def best_type(header: str | None, offered: Mapping[str, str]) -> str | None:
    """Return the name of the media type that a header Accept prefers; the first where all are alike; None: no one.

    Parameters
    ----------
    header : str or None
        The header; None accepts everything.
    offered : mapping of str to str
        Media types to their names, the one to be preferred first.
    """
    if not header:
        return next(iter(offered.values()))
    weights = _weights(header)
    found = []
    for place, (media_type, name) in enumerate(offered.items()):
        family = media_type.partition("/")[0] + "/*"
        weight = next((weights[key] for key in (media_type, family, "*/*") if key in weights), 0.0)
        found.append((-weight, place, name))
    weight, _, name = min(found)
    return name if weight < 0.0 else None


def _weights(header: str) -> dict[str, float]:
    weights = {}
    for part in header.split(","):
        name, *parameters = (piece.strip().lower() for piece in part.split(";"))
        weight = 1.0
        for parameter in parameters:
            key, _, value = parameter.partition("=")
            if key.strip() == "q":
                try:
                    weight = min(max(float(value), 0.0), 1.0)
                except ValueError:
                    weight = 0.0
        weights[name] = weight
    return weights
