"""The verb that lists the settings."""

from vgps.config.reference import defaults_yaml, reference_text


def config(*, defaults: bool = False) -> None:
    """List every setting with its default, unit and meaning.

    Args:
        defaults: Print a commented YAML file of all defaults instead, for `--config`.
    """
    print(defaults_yaml() if defaults else reference_text(), end="")
