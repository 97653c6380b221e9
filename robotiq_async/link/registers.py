"""The register map of a gripper, from its address and the options of a hand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from ..values.checks import check_int
from ..values.model import model_of
from ..values.registers import REGISTER_COUNT, RegisterMap
from .address import Address

LAST_BLOCK: Final = 0x10000 - REGISTER_COUNT
"""The highest first register of a block: registers are numbered to 0xFFFF."""
_WRITE_FUNCTIONS: Final = (16, 23)


def registers_of(
    address: Address,
    *,
    device_id: object = None,
    read_function: object = None,
    write_function: object = None,
    request_address: object = None,
    status_address: object = None,
) -> RegisterMap:
    """The register map of a gripper; None stands for the usual value of the link."""
    model = model_of(address.model)
    usual = model.rtu if address.is_rtu else model.tcp
    # On a serial line 0 is a broadcast, which no device answers, and ids above 247 are reserved. Over TCP
    # grippers in the field answer to any id, and drivers have used 0 and 255. A URCap has a serial line.
    units = (1, 247) if address.is_rtu or address.kind == "urcap" else (0, 255)
    return RegisterMap(
        request=_int_or("request_address", request_address, 0, LAST_BLOCK, usual.request),
        status=_int_or("status_address", status_address, 0, LAST_BLOCK, usual.status),
        read_function=_int_or("read_function", read_function, 3, 4, usual.read_function),
        device_id=_int_or("device_id", device_id, *units, usual.device_id),
        count=usual.count,
        write_function=check_write_function(
            usual.write_function if write_function is None else write_function
        ),
        is_sure=write_function is not None,
    )


def check_urcap(address: Address, options: Mapping[str, object]) -> None:
    """Refuse models that cannot be behind a URCap, and options that mean nothing there.

    Raises:
        ValueError: the model has more than one axis or is not named, or an option is one of Modbus.
    """
    if len(model_of(address.model).axes) > 1:
        raise ValueError(
            f"a gripper behind a URCap is a 2F-85, 2F-140 or Hand-E: name it, as in {address}?model=2f85"
            if address.model is None
            else f"{address}: Robotiq's URCap has no {address.model.title}"
        )
    for option, given in options.items():
        if given is not None and option != "device_id":
            raise ValueError(f"{option} is an option of Modbus, and {address} is not Modbus")


def check_write_function(value: object) -> int:
    """A Modbus function that writes the request registers."""
    function = check_int("write_function", value, *_WRITE_FUNCTIONS)
    if function not in _WRITE_FUNCTIONS:
        raise ValueError(f"write_function must be 16 or 23, got {function}")
    return function


def _int_or(name: str, value: object, low: int, high: int, usual: int) -> int:
    return usual if value is None else check_int(name, value, low, high)
