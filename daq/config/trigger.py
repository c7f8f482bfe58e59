"""The trigger of a rig, changed for one recording."""

from dataclasses import replace

from pydantic import ValidationError

from daq.config.checks import trigger_faults
from daq.config.rig import Rig
from daq.config.schema import TriggerSection
from daq.config.write import to_toml
from daq.errors import ConfigError


def with_trigger(rig: Rig, start: str | None, stop: str | None, before: float | None) -> Rig:
    """Return the rig with another trigger; what is None stays as it is.

    Parameters
    ----------
    rig : Rig
        The rig.
    start, stop : str or None
        Conditions, as in `[trigger]`.
    before : float or None
        Samples from so long before the start are recorded too, s.

    Raises
    ------
    ConfigError
        A condition is none or on what does not exist, or the time is too long.
    """
    given = {"start": start, "stop": stop, "pre_s": before}
    if start is None and stop is None and before is None:
        return rig
    changed = rig.config.trigger.model_dump() | {key: value for key, value in given.items() if value is not None}
    try:
        trigger = TriggerSection.model_validate(changed)
    except ValidationError as error:
        told = [f"trigger.{each['loc'][0]} = {each['input']}: {each['msg']}" for each in error.errors()]
        raise ConfigError("the trigger that was asked for", told) from error
    config = rig.config.model_copy(update={"trigger": trigger})
    if faults := [fault.text for fault in trigger_faults(config)]:
        raise ConfigError("the trigger that was asked for", faults)
    return replace(rig, config=config, toml=to_toml(config.model_dump(mode="json", exclude_none=True)))
