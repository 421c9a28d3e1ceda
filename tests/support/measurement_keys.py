"""The keys of ``measurements.npz`` that its table documents."""

from vgps.writers import measurements


def documented() -> set[str]:
    """Keys of the module's table."""
    rows = [
        line[:31].strip() for line in measurements.__doc__.splitlines() if line[32:44].strip().startswith("(")
    ]
    keys = set()
    for row in rows:
        first, *others = row.split(", ")
        prefix = first.rpartition(".")[0]
        keys |= {first, *(name if "." in name or not prefix else f"{prefix}.{name}" for name in others)}
    return keys
