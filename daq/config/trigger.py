"""The trigger of a rig, changed for one recording."""

from dataclasses import replace

from pydantic import ValidationError

from daq.config.checks import trigger_faults
from daq.config.rig import Rig
from daq.config.schema import TriggerSection
from daq.config.toml_writer import to_toml
from daq.errors import ConfigError


def with_trigger(rig: Rig, **asked: str | float | None) -> Rig:
    """Return the rig with another trigger.

    Parameters
    ----------
    rig : Rig
        The rig.
    **asked : str, float or None
        Keys of `[trigger]`; what is None stays as it is.

    Raises
    ------
    ConfigError
        A condition is none or on what does not exist, or a time or number is out of its range.
    """
    given = {key: value for key, value in asked.items() if value is not None}
    if not given:
        return rig
    try:
        trigger = TriggerSection.model_validate(rig.config.trigger.model_dump() | given)
    except ValidationError as error:
        told = [f"trigger.{each['loc'][0]} = {each['input']}: {each['msg']}" for each in error.errors()]
        raise ConfigError("the trigger that was asked for", told) from error
    config = rig.config.model_copy(update={"trigger": trigger})
    if faults := [fault.text for fault in trigger_faults(config)]:
        raise ConfigError("the trigger that was asked for", faults)
    return replace(rig, config=config, toml=to_toml(config.model_dump(mode="json", exclude_none=True)))
