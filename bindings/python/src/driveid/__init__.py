# SPDX-License-Identifier: Apache-2.0
"""driveid: identify electric drives, compare the model with measurements, learn which effect is missing.

    import driveid
    model = driveid.Model.new("rigid_axis", K_t_Nm_A=0.05)
    record = driveid.read("run.csv")
    fitted = driveid.fit(model, record)
    fitted.parameters["J_kgm2"].value
"""

from . import discrete, lti, modal, shifting, sinusoids
from ._core import version as __version__
from .analysis import Comparison, Explanation, Fit, Improvement, Power, catalogue, compare, explain, fit, improve, power, series
from .errors import Cancelled, DataError, DriveidError, FileError, UsageError
from .model import Effect, Model, Parameter
from .records import Record, read, read_all

__all__ = ["Cancelled", "Comparison", "DataError", "DriveidError", "Effect", "Explanation", "FileError", "Fit", "Improvement", "Model", "Parameter",
           "Power", "Record", "UsageError", "__version__", "catalogue", "compare", "discrete", "explain", "fit", "improve", "lti", "modal", "power", "read", "read_all", "series", "shifting", "sinusoids"]
