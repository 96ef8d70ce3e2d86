"""Fig. 11 at the settings of Sec. 3.3.3: EoEn for three radii."""

from redo import redo

if __name__ == "__main__":
    redo("11")
