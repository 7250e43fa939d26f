"""Compression of Hankel data to a projection, by one of two routes."""

from dataclasses import dataclass

import numpy as np

from ankleloop.errors import DataError
from ankleloop.subspace.gram_projection import project_gram
from ankleloop.subspace.hankel_gram import HankelGram
from ankleloop.subspace.projection import project
from ankleloop.subspace.records import batch_hankel

__all__ = ["COMPRESSIONS", "HankelRows", "compressed", "projected_gram"]

COMPRESSIONS = ("gram", "qr")


@dataclass(frozen=True)
class HankelRows:
    """Which rows of Hankel matrices a projection takes, of records that hold inputs, outputs and maybe a reference.

    Parameters
    ----------
    inputs, outputs : int
        Numbers of channels.
    instruments : ndarray of int
        Channels that the instruments consist of.
    block_rows : int
        Block rows of the future.
    past, leads : int
        Block rows of the instruments before the future and within it.
    """

    inputs: int
    outputs: int
    instruments: np.ndarray
    block_rows: int
    past: int
    leads: int

    @property
    def window(self):
        """Samples that one column reaches over."""
        return self.past + self.block_rows

    @property
    def sizes(self):
        """Rows of future inputs and of instruments."""
        return self.inputs * self.block_rows, self.instruments.size * (self.past + self.leads)

    @property
    def total(self):
        """Rows of all three matrices."""
        return sum(self.sizes) + self.outputs * self.block_rows

    @property
    def matrices(self):
        """Channels, first block row and block rows of U, Z and Y."""
        u, y = np.arange(self.inputs), self.inputs + np.arange(self.outputs)
        future = self.past, self.block_rows
        return (u, *future), (self.instruments, 0, self.past + self.leads), (y, *future)

    def gram(self, channels):
        """What to add a record of so many channels to."""
        lags = np.full(channels, self.block_rows)
        lags[self.instruments] = self.window  # they are of the past, all others of the future alone
        return HankelGram(self.window, lags)

    def indices(self, channels):
        """The rows of U, Z and Y among those of the Hankel matrix of all channels over the whole window."""
        return np.concatenate(
            [(np.arange(first, first + rows)[:, None] * channels + used).ravel() for used, first, rows in self.matrices]
        )

    def check(self, samples):
        """Refuse records, given by their lengths, with fewer columns than rows; return the number of columns."""
        columns = sum(max(0, length - self.window + 1) for length in samples)
        if columns < self.total:
            raise DataError(
                f"the record of {' + '.join(map(str, samples))} samples is shorter than its Hankel window: "
                f"{self.total} Hankel rows need at least {self.total + self.window - 1} samples. Record longer, or use "
                "fewer block_rows or instrument_rows."
            )
        return columns


def compressed(records, rows, form, rank_tolerance, order, compression="gram"):
    """Projection of the records of one system.

    Parameters
    ----------
    records : list of ndarray, shape (N, channels) each
        Inputs, outputs and reference side by side, scaled; of one record or of several.
    rows : HankelRows
        Which rows to take.
    form : {"ordinary", "correlation"}
        Form of the projection.
    rank_tolerance : float
        Singular values below this fraction of the largest one are rounding.
    order : int
        Order to be found.
    compression : {"gram", "qr"}
        Route; "gram" goes over to "qr" where it is not accurate enough.

    Returns
    -------
    Projection
    str
        The route that was taken.

    Raises
    ------
    DataError
        If the records or the instruments do not suffice.
    """
    columns = rows.check([record.shape[0] for record in records])
    if compression == "gram":
        grams = []
        for record in records:
            if record.shape[0] >= rows.window:
                grams.append(rows.gram(record.shape[1]))
                grams[-1].add(record)
        found = projected_gram(grams, rows, form, rank_tolerance, order)
        if found is not None:
            return found, "gram"
    own = {"own_means": len(records) > 1}  # of a single record the projection removes them
    u, z, y = (
        batch_hankel([record[:, used] for record in records], first, count, rows.window, **own)
        if used.size
        else np.empty((0, columns))
        for used, first, count in rows.matrices
    )
    return project(u, y, z, form, rank_tolerance, order), "qr"


def projected_gram(grams, rows, form, rank_tolerance, order):
    """Projection from the inner products of each record, or None where they are not accurate enough.

    Parameters
    ----------
    grams : list of HankelGram
        One for each record.
    rows : HankelRows
        Which rows to take.
    form, rank_tolerance, order
        As `compressed` takes them.

    Returns
    -------
    Projection or None
    """
    chosen = rows.indices(len(grams[0].lags))
    total = grams[0].matrix(chosen)
    for gram in grams[1:]:
        total = total + gram.matrix(chosen)
    columns = sum(gram.columns for gram in grams)
    return project_gram(total, rows.sizes, columns, form, rank_tolerance, order)
