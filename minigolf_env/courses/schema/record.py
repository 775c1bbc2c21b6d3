"""Field types of course files, and the base class of their records.

Lengths are in metres. Angles are in degrees, counter-clockwise seen from above, with 0 along x.
"""

from __future__ import annotations

from typing import Annotated, Any, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer, model_validator
from pydantic_core import PydanticCustomError

from minigolf_env._validation import closest_choice, quote
from minigolf_env.courses.schema.limits import MAX_COURSE_COORDINATE

Number: TypeAlias = Annotated[
    float, Field(strict=True, ge=-MAX_COURSE_COORDINATE, le=MAX_COURSE_COORDINATE, allow_inf_nan=False)
]
Length: TypeAlias = Annotated[float, Field(strict=True, gt=0.0, le=MAX_COURSE_COORDINATE, allow_inf_nan=False)]
Fraction: TypeAlias = Annotated[float, Field(strict=True, ge=0.0, le=1.0)]
PointXY: TypeAlias = tuple[Number, Number]
PointXYZ: TypeAlias = tuple[Number, Number, Number]
NameField: TypeAlias = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 _.-]{0,63}$")]
HexColor: TypeAlias = Annotated[str, Field(pattern="^#[0-9a-fA-F]{6}$", description='sRGB colour such as "#c03020".')]
NumSides: TypeAlias = Annotated[int, Field(strict=True, ge=3, le=512)]
Degrees: TypeAlias = Annotated[float, Field(strict=True, ge=-360.0, le=360.0)]


class Record(BaseModel):
    """Base class of all records: an unknown key is an error that suggests the key that was probably meant."""

    # Validators are built on first use: loading a file needs the one of CourseFile only.
    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True, defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _check_keys(cls, data: Any) -> Any:
        if isinstance(data, dict):
            for key in data:
                if key not in cls.model_fields:
                    closest = closest_choice(key, cls.model_fields)
                    hint = f"did you mean {quote(closest)}?" if closest else f"known are {', '.join(cls.model_fields)}."
                    raise PydanticCustomError(
                        "unknown_key", "{message}", {"message": f"unknown key {quote(key)}; {hint}"}
                    )
        return data

    @model_serializer(mode="wrap")
    def _keep_kind(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Write ``kind`` even where defaults are left out: a file that is read must have it."""
        data: dict[str, Any] = handler(self)
        kind = getattr(self, "kind", None)
        return data if kind is None else {"kind": kind} | data
