"""Fig. 9 at the settings of Sec. 3.3.2: (a) index 1 and 2, (b) three widths of the gap."""

from redo import redo

if __name__ == "__main__":
    redo("9a", "9b")
