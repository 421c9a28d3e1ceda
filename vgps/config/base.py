"""What every settings model is: frozen, every field defaulted, unknown keys refused."""

from pydantic import BaseModel, ConfigDict


class SettingsModel(BaseModel):
    """Base of all settings."""

    model_config = ConfigDict(extra="forbid", frozen=True)
