"""Signal processing on plain arrays: decimation, derivatives, spectra, discretisation, sampling rates, VAF."""
