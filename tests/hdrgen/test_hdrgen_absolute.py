"""--absolute: cd/m2 from time, f-number and ISO, by ISO 12232's saturation-based speed."""
import numpy as np
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from conftest import one_line_error
from hdrgen_util import expose, f_srgb, hdrgen, radiance, read_exr, scene


def shots(folder, f_numbers, isos, times=(.125, .5, 2)):
    """Pictures of a scene in cd/m2 by a camera whose highest code is 120 N^2 / (S t)."""
    truth = scene(60, 60, decades=2, lowest=0)
    names, rng = [], np.random.default_rng(1)
    for k, (t, n, iso) in enumerate(zip(times, f_numbers, isos)):
        exif = Image.Exif()
        exif[0x8769] = {tag: value for tag, value in ((0x829A, IFDRational(round(t * 1000), 1000)),
                                                      (0x829D, n and IFDRational(round(n * 10), 10)), (0x8827, iso)) if value}
        names.append(f"a{k}.jpg")
        Image.fromarray(expose(truth, t * iso / (120 * n * n) if n else t / 100, f_srgb, rng=rng)).save(
            folder / names[-1], exif=exif, quality=98, subsampling=0)
    return names, truth


def test_luminance_by_speed(tmp_path):
    for f_numbers, isos in (((4, 4, 4), (200, 200, 200)), ((4, 2.8, 4), (100, 100, 400))):
        names, truth = shots(tmp_path, f_numbers, isos)
        r = hdrgen(tmp_path, names, "--absolute", "--response", "srgb", times=None)
        assert "half a stop" in r.err
        assert abs(np.median(np.log2(179 * radiance(tmp_path / "out.exr") / truth))) < .02
        assert abs(read_exr(tmp_path / "out.exr")[1]["whiteLuminance"] - 179) < 1e-3
        hdrgen(tmp_path, names[::-1], "--absolute", "--response", "srgb", times=None, out="back.exr")
        assert np.allclose(radiance(tmp_path / "back.exr"), radiance(tmp_path / "out.exr"), rtol=1e-3)


def test_unknown_settings_are_refused(tmp_path):
    names, _ = shots(tmp_path, (0, 0, 0), (200, 200, 200))
    one_line_error(hdrgen(tmp_path, names, "--absolute", "--response", "srgb", times=None, code=1), "hdrgen", "f-number", "--calibrate")
    assert not (tmp_path / "out.exr").exists()
