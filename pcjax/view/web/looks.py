"""After how many trials the page looks at a design."""

MOVING = (200,)
"""While something is dragged."""

AT_REST = (200, 1000, 2000, 3000, 4000, 5000)
"""Once it rests: at once, then better, in parts, so that the next move does not wait for long."""
