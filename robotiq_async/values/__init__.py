"""Words of the wire: names, models, requests, status, results, errors. Pure: no file, no clock."""
