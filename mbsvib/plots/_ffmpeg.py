"""The program that writes MP4: the one on the path, or the one that comes with the package imageio-ffmpeg."""

from __future__ import annotations

from shutil import which

from mbsvib.errors import ExportError


def program() -> str:
    """Return the path of ffmpeg: of matplotlib's setting and the path first, then that of imageio-ffmpeg."""
    from matplotlib import rcParams

    path = which(rcParams["animation.ffmpeg_path"])
    if path is None:
        try:
            from imageio_ffmpeg import get_ffmpeg_exe

            path = get_ffmpeg_exe()
        except (ImportError, RuntimeError) as error:  # RuntimeError: the package brings no program for this machine
            raise ExportError('MP4 needs the program ffmpeg, which is not found; install it with:  pip install '
                              '"mbsvib[video]"  or write a .gif or .html.') from error  # fmt: skip
    return str(path)
