"""Types of settings that pydantic does not have."""

from typing import Annotated

from pydantic import Field

Share = Annotated[float, Field(gt=0.0, lt=1.0)]
"""A part of a whole, above 0 and below 1: 0.05 is 5 %."""

Fraction = Annotated[float, Field(gt=0.0, le=1.0)]
"""A ratio to the largest possible value, which it may reach."""
