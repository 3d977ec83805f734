"""What the page may ask for: JSON messages, checked before anything is done with them."""

from __future__ import annotations

import json
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from bowden.errors import BadInput

#: Names of files: one level, no path.
FileName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}$")]
ReportName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}\.html$")]


class _Order(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Alive(_Order):
    """The page is there and draws."""

    do: Literal["alive"]


class StopDrive(_Order):
    """Quick stop, bridge off."""

    do: Literal["stop"]


class StartDrive(_Order):
    """Turn the bridge on; `torque_nm` with mode torque."""

    do: Literal["start"]
    mode: Literal["tunnel", "torque"]
    torque_nm: float | None = None


class BeginRecording(_Order):
    """Record into the folder; the name gets ``.blf``."""

    do: Literal["record"]
    name: FileName
    notes: str = Field(default="", max_length=500)


class RunExperiment(_Order):
    """Record an experiment into the folder; motor and recording end by themselves."""

    do: Literal["run"]
    experiment: str = Field(max_length=20)
    values: dict[str, float] = Field(default_factory=dict, max_length=20)
    name: FileName


class CloseRecording(_Order):
    """End the recording under way."""

    do: Literal["end_recording"]


class SetPageMark(_Order):
    """Mark this moment in the recording."""

    do: Literal["mark"]
    text: str = Field(default="mark", min_length=1, max_length=100)


class ChangeValues(_Order):
    """Show what would change in the drive's configuration, or change it."""

    do: Literal["configure"]
    values: dict[str, float | str] = Field(min_length=1, max_length=200)
    dry_run: bool = True


class Examine(_Order):
    """Compare recordings with the model, diagnose them, or put them into the paper's figures."""

    do: Literal["compare", "diagnose", "figures"]
    recordings: list[FileName] = Field(min_length=1, max_length=20)
    experiment: Literal["1a", "2", "3"] = "2"


class ApplyModel(_Order):
    """Write the model that the last diagnosis made to the drive."""

    do: Literal["apply_model"]
    dry_run: bool = True


Order = (
    Alive
    | StopDrive
    | StartDrive
    | BeginRecording
    | RunExperiment
    | CloseRecording
    | SetPageMark
    | ChangeValues
    | Examine
    | ApplyModel
)
_ORDER: TypeAdapter[Order] = TypeAdapter(Annotated[Order, Field(discriminator="do")])


def read_order(text: str) -> Order:
    """Read a message of the page.

    Raises
    ------
    BadInput
        No JSON, an order that there is not, a field that does not fit.
    """
    try:
        return _ORDER.validate_python(json.loads(text))
    except json.JSONDecodeError as error:
        raise BadInput("order", text[:40], "JSON") from error
    except ValidationError as error:
        problems = "; ".join(
            f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in error.errors()
        )
        raise BadInput("order", problems, "an order of the page") from error
