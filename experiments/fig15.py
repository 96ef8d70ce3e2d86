"""Fig. 15: the conditions of Figs. 13 and 14 against the width between the fingertips."""

from redo import redo

if __name__ == "__main__":
    redo("15")
