# SPDX-License-Identifier: BSD-3-Clause
"""Common code of the pictures of scripts/evaluate: no screen, plain axes."""

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402


def images_folder(output):
    """Of the report in the folder `output`."""
    images = output / "images"
    images.mkdir(exist_ok=True)
    return images


def clean(ax):
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(alpha=0.25, lw=0.6, which="both")


def save(figure, path, handles=(), **legend):
    """With a legend of the handles, if there are any, below everything."""
    if handles:
        figure.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.0), frameon=False,
                      **{"ncol": len(handles), **legend})
    figure.savefig(path, dpi=110, bbox_inches="tight")
    pyplot.close(figure)
