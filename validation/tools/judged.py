"""Rows with a reference and a tolerance: a quantity, what was measured, whether it passes."""


def row(quantity, measured, reference=0.0, tolerance=0.0, order=None):
    """It passes where |measured - reference| <= tolerance; `order`: observed order of convergence."""
    return {"quantity": quantity, "measured": measured, "reference": reference, "tolerance": tolerance, "order": order}


def passes(one):
    if one["measured"] is None or one["reference"] is None:
        return False
    return abs(one["measured"] - one["reference"]) <= one["tolerance"]


def _number(value, digits=7):
    return "" if value is None else f"{value:.{digits}g}"


def table(rows):
    """Lines of a Markdown table."""
    lines = ["| quantity | measured | reference | tolerance | order | |", "|---|---|---|---|---|---|"]
    for one in rows:
        lines.append(f"| {one['quantity']} | {_number(one['measured'])} | {_number(one['reference'])} | "
                     f"{_number(one['tolerance'], 3)} | {_number(one['order'], 3)} | {'ok' if passes(one) else 'OFF'} |")
    return lines


def verdict(rows):
    """Says how many are off; the exit status."""
    off = sum(not passes(one) for one in rows)
    print(f"{off} quantities are off" if off else "all quantities within their tolerances")
    return 1 if off else 0
