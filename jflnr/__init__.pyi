from . import temporal as temporal
from .bmfr.pipeline import BMFR as BMFR
from .denoising import Denoiser as Denoiser
from .denoising import denoise as denoise
from .frame import Frame as Frame
from .frame import composite as composite
from .frame import read_frame as read_frame
from .frame import read_header as read_header
from .frame import write_frame as write_frame
from .methods import BACKENDS as BACKENDS
from .methods import METHODS as METHODS
from .network.flnr import FLNR as FLNR
from .network.flnr import flnr as flnr
from .parameters import load_parameters as load_parameters
from .parameters import save_parameters as save_parameters
from .regression.adaptive import AdaptiveFLR as AdaptiveFLR
from .regression.adaptive import flr_adaptive as flr_adaptive
from .regression.auto import Auto as Auto
from .regression.flr import FLR as FLR
from .regression.flr import flr as flr
from .regression.picture import Picture as Picture
from .regression.picture import denoise_picture as denoise_picture

__version__: str
