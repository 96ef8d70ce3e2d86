"""Fig. 14 at the settings of Sec. 3.6.2: arm and circle against theta_i2."""

from redo import redo

if __name__ == "__main__":
    redo("14")
