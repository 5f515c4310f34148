"""Report text on sensors: marker tracking, completeness of samples, and time skew of synchronised streams."""

from collections.abc import Mapping

from hric_analysis.collection import BOUND, SourceMetrics, StreamMetrics, TimeError
from hric_analysis.tracking import SMOOTHED, Accelerations, TrackingMetrics


def tracking(values: TrackingMetrics) -> str:
    """Return the report text on marker tracking."""
    frames, stamps, parts = values.frames, values.stamp_error, []
    lag = "not known: too little motion" if values.lag is None else f"{1e3 * values.lag:.1f} ms"
    if values.rms_error is None or values.largest_error is None or values.acceleration is None:
        parts.append(f"{values.controller}: no valid marker of {values.body or 'any body'} was received")
    else:
        parts += [
            f"{values.controller} follows {values.body} (reference: {values.marker}), from "
            f"{values.first_marker:.3f} s on:",
            f"  lag {lag}; after compensation of the lag: RMS error {1e3 * values.rms_error:.2f} mm, largest "
            f"{1e3 * values.largest_error:.2f} mm",
            "  " + _acceleration(values.acceleration),
        ]
    latency = "" if frames.latency_median is None else f", latency {1e3 * frames.latency_median:.1f} ms (median)"
    refused = ", ".join(f"{count} {reason}" for reason, count in values.refused.items())
    parts.append(
        f"  frames: {frames.received} received, {frames.lost} lost, {frames.untracked} without the body{latency}; "
        f"marker lost {values.losses} times" + (f"; markers rejected: {refused}" if refused else "")
    )
    if stamps is not None:
        errors = (stamps.mean, stamps.uncertainty), (stamps.largest, stamps.largest_uncertainty)
        mean, largest = (f"{1e3 * error:+.3f} ms (+-{1e3 * sigma:.3f})" for error, sigma in errors)
        parts.append(
            f"  error of the time stamps: mean {mean}, largest {largest} (averaged over {stamps.window:g} s); +-: "
            "uncertainty due to noise"
        )
    return "\n".join(parts)


def _acceleration(values: Accelerations) -> str:
    text = f"RMS acceleration {values.measured:.3f} m/s2"
    if not values.ideal:
        return text
    return (
        f"{text}, {values.ratio:.2f} times that of the marker, {values.ideal:.3f} m/s2 "
        f"({values.ratio_smoothed:.2f} times if averaged over {SMOOTHED} cycles)"
    )


def collection(sources: Mapping[str, SourceMetrics], streams: Mapping[str, StreamMetrics]) -> str:
    """Return the report text on recorded samples of each source, and on synchronised streams."""
    lines = []
    for topic, source in sources.items():
        if source.sent is None:
            text = (
                f"{source.recorded} {source.counts} recorded, {source.driver_lost} lost according to the driver; "
                "number of sent samples not known"
            )
        else:
            text = f"{source.sent} {source.counts} sent, {source.recorded} recorded, {source.lost} lost"
            text += f", {source.twice} twice" * bool(source.twice)
        stamps = "" if source.stamps is None else f"; error of the time stamps {_milliseconds(source.stamps)}"
        lines.append(f"{topic}: {text}{stamps}")
    for topic, stream in streams.items():
        missing = "" if stream.missing is None else f" of {stream.expected}, {stream.missing} missing"
        lines.append(
            f"{topic} ({stream.rate:g} Hz): {stream.ticks} ticks{missing}; accepted skew: at most "
            f"{1e3 * stream.bound:g} ms"
        )
        for name, part in stream.sources.items():
            skew = "not known" if part.skew is None else f"{_milliseconds(part.skew)}, judged by the {part.by}"
            share = "" if part.valid is None else f"valid for {100 * part.valid:.2f} % of the ticks; "
            lines.append(f"  {name}: {share}skew {skew}")
    return "\n".join(lines)


def _milliseconds(error: TimeError) -> str:
    noise = "" if error.uncertainty is None else f" +-{1e3 * error.uncertainty:.3f}"
    return (
        f"{1e3 * error.median:.3f} ms (median), {1e3 * error.p99:.3f} (99 %), {1e3 * error.largest:.3f} (largest), "
        f"{100 * error.within_bound:.1f} % within {1e3 * BOUND:g} ms{noise}"
    )
