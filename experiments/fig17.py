"""Fig. 17 at the settings of Sec. 3.6.3: arm and stick by its initial orientation."""

from redo import redo

if __name__ == "__main__":
    redo("17")
