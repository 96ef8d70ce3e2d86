"""Fig. 12 at the settings of Sec. 3.3.3: the score for three radii."""

from redo import redo

if __name__ == "__main__":
    redo("12")
