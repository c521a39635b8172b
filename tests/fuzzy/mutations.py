"""Malformed texts: valid ones with pieces removed, repeated, swapped or replaced."""

from hypothesis import strategies as st

from tests.fuzzy.systems import composite


@composite
def mutated(draw, texts, pieces):
    """Draw one of ``texts`` and replace some of its parts by others and by ``pieces``."""
    text = draw(st.sampled_from(texts))
    for _ in range(draw(st.integers(1, 3))):
        at = st.integers(0, len(text))
        start, end = sorted((draw(at), draw(at)))
        end = min(end, start + draw(st.sampled_from([0, 1, 5, 40, 10_000])))
        other = draw(at)
        new = draw(
            st.sampled_from(["", text[start:end] * 2, text[other : other + 30]])
            | st.sampled_from(pieces)
            | st.text(max_size=5)
        )
        text = text[:start] + new + text[end:]
    return text
