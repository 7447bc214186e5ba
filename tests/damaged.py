"""Two thousand files that are no photo, no longer a photo, or a strange one; and reading them.

`write_inputs` writes the files; run as a program it reads all of them, in a process of its own
so that crashes, time and memory can be measured, and prints a line of JSON for each.
"""

from __future__ import annotations

import io
import json
import os
import struct
import sys
import time
import traceback
import warnings
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageCms, features

WIDTH, HEIGHT = 64, 48
SUFFIXES = ("jpg", "png", "webp", "tif", "gif", "bmp", "jpeg", "txt", "heic", "PNG", "")
#: How many damaged copies there are of each original.
COPIES = 36


def picture(width: int = WIDTH, height: int = HEIGHT) -> Image.Image:
    """A gradient with a few buttons and some noise."""
    y, x = np.mgrid[:height, :width]
    colours = np.stack([x * 255 // width, y * 255 // height, (x + y) % 256], axis=-1)
    for cx, cy in ((16, 12), (16, 34), (46, 12), (46, 34)):
        colours[np.hypot(x - cx, y - cy) < 7] = (230, 200, 40)
    noise = np.random.default_rng(5).integers(-6, 7, colours.shape)
    return Image.fromarray(np.clip(colours + noise, 0, 255).astype(np.uint8))


def saved(image: Image.Image, kind: str, turns: tuple[int, ...] = (), **options: object) -> bytes:
    """The file's bytes; with more frames for all turns."""
    if turns:
        options |= {"save_all": True, "append_images": [image.rotate(turn) for turn in turns]}
    stream = io.BytesIO()
    image.copy().save(stream, kind, **options)  # saving leaves traces in an image
    return stream.getvalue()


def originals() -> dict[str, tuple[bytes, bool]]:
    """Whole files, by name; and whether a photo may be like that."""
    rgb = picture()
    rgba = rgb.copy()
    rgba.putalpha(rgb.convert("L"))
    grey, cmyk, palette, bilevel = (rgb.convert(mode) for mode in ("L", "CMYK", "P", "1"))
    deep = Image.fromarray(np.asarray(grey).astype(np.uint16) * 257)
    turns = (180, 90)
    exif = Image.Exif()
    exif[0x0112] = 6
    exif.get_ifd(0x8769).update({0x920A: 4.2, 0xA405: 26, 0xA20E: 5000.0, 0xA210: 2})
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    deep_colours = np.asarray(rgb)[..., ::-1].astype(np.uint16) * 257
    light = np.asarray(rgb).astype(np.float32) / 50
    found = {
        "baseline.jpg": saved(rgb, "JPEG", quality=90),
        "progressive.jpg": saved(rgb, "JPEG", progressive=True),
        "exif.jpg": saved(rgb, "JPEG", exif=exif),
        "profile.jpg": saved(rgb, "JPEG", icc_profile=profile, comment=b"hall"),
        "restarts.jpg": saved(rgb, "JPEG", restart_marker_blocks=2, optimize=True),
        "grey.jpg": saved(grey, "JPEG"),
        "cmyk.jpg": saved(cmyk, "JPEG"),
        "stereo.mpo": saved(rgb, "MPO", turns),
        "rgb.png": saved(rgb, "PNG"),
        "rgba.png": saved(rgba, "PNG"),
        "exif.png": saved(grey, "PNG", exif=exif, icc_profile=profile, dpi=(72, 72)),
        "grey_alpha.png": saved(rgba.convert("LA"), "PNG"),
        "palette.png": saved(palette, "PNG", transparency=bytes(range(256))),
        "bilevel.png": saved(bilevel, "PNG"),
        "deep.png": saved(deep, "PNG"),
        "deep_colours.png": cv2.imencode(".png", deep_colours)[1].tobytes(),
        "animated.png": saved(rgb, "PNG", turns),
        "plain.tif": saved(rgb, "TIFF", exif=exif),
        "lzw.tif": saved(rgba, "TIFF", compression="tiff_lzw"),
        "deflate.tif": saved(rgb, "TIFF", compression="tiff_adobe_deflate"),
        "packbits.tif": saved(palette, "TIFF", compression="packbits"),
        "jpeg.tif": saved(rgb, "TIFF", compression="jpeg"),
        "fax.tif": saved(bilevel, "TIFF", compression="group4"),
        "cmyk.tif": saved(cmyk, "TIFF"),
        "big.tif": saved(rgb, "TIFF", big_tiff=True),
        "deep.tif": saved(deep, "TIFF"),
        "tiles.tif": tiff(64, 48, [8, 8, 8], bytes(range(256)) * 3, rows=16, tile_width=16),
        "pages.tif": saved(rgb, "TIFF", turns, compression="tiff_lzw"),
        "deep_colours.tif": cv2.imencode(".tif", deep_colours)[1].tobytes(),
        "lossy.webp": saved(rgb, "WEBP", exif=exif),
        "lossless.webp": saved(rgba, "WEBP", lossless=True),
        "animated.webp": saved(rgb, "WEBP", turns),
        "still.gif": saved(palette, "GIF"),
        "animated.gif": saved(rgb, "GIF", turns),
        "rgb.bmp": saved(rgb, "BMP"),
        "palette.bmp": saved(palette, "BMP"),
        "runs.bmp": run_length_bmp(64, 48, b"\x40\x07\0\0" * 48 + b"\0\1"),
        "rgb.ppm": saved(rgb, "PPM"),
        "text.ppm": b"P3 64 48 255\n" + b" 128 7 250" * 64 * 48,
        "deep.pgm": b"P5 64 48 65535\n" + np.asarray(deep).astype(">u2").tobytes(),
        "runs.tga": saved(rgb, "TGA", compression="tga_rle"),
        "rgb.sgi": saved(rgb, "SGI"),
        "rgb.pcx": saved(rgb, "PCX"),
        "rgb.qoi": saved(rgb, "QOI"),
        "icon.ico": saved(rgb.resize((64, 64)), "ICO", sizes=[(64, 64)]),
    }
    if features.check("jpg_2000"):
        found["rgb.jp2"] = saved(rgb, "JPEG2000")
    if features.check("avif"):
        found["rgb.avif"] = saved(rgb, "AVIF", speed=10)
    strange = {
        "float.tif": saved(Image.fromarray(light[..., 0]), "TIFF"),
        "integers.tif": saved(Image.fromarray(np.full((48, 64), 70_000, np.int32)), "TIFF"),
        "light.tif": cv2.imencode(".tif", light)[1].tobytes(),
        "light.hdr": cv2.imencode(".hdr", light)[1].tobytes(),
        "icon.icns": saved(rgb.resize((64, 64)), "ICNS"),
    }
    return {name: (content, True) for name, content in found.items()} | {
        name: (content, False) for name, content in strange.items()
    }


def chunk(kind: bytes, content: bytes) -> bytes:
    """One chunk of a PNG."""
    check = struct.pack(">I", zlib.crc32(kind + content))
    return struct.pack(">I", len(content)) + kind + content + check


def png(width: int, height: int, bits: int, colour: int, *chunks: bytes) -> bytes:
    header = struct.pack(">IIBBBBB", width, height, bits, colour, 0, 0, 0)
    content = (chunk(b"IHDR", header), *chunks, chunk(b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(content)


def tiff(
    width: int,
    height: int,
    bits: list[int],
    block: bytes,
    *,
    rows: int,
    tile_width: int = 0,
    photometric: int = 2,
) -> bytes:
    """A TIFF all strips (or tiles) of which are one block, so that it may be small and large."""
    count = -(-height // rows) * (-(-width // tile_width) if tile_width else 1)
    entries = {256: [width], 257: [height], 258: bits, 259: [1], 262: [photometric]}
    entries |= {277: [len(bits)]}
    if tile_width:
        entries |= {322: [tile_width], 323: [rows], 324: [0] * count, 325: [len(block)] * count}
    else:
        entries |= {273: [0] * count, 278: [rows], 279: [len(block)] * count}
    place = 8 + 2 + 12 * len(entries) + 4
    fields, long_values = b"", b""
    start = place + sum(4 * len(values) for values in entries.values() if len(values) > 1)
    for tag, values in sorted(entries.items()):
        packed = np.array(values, "<u4") if tag not in (273, 324) else np.full(count, start, "<u4")
        fields += struct.pack("<HHI", tag, 4, len(values))
        if len(values) == 1:
            fields += packed.tobytes()
        else:
            fields += struct.pack("<I", place + len(long_values))
            long_values += packed.tobytes()
    head = b"II*\0" + struct.pack("<IH", 8, len(entries))
    return head + fields + bytes(4) + long_values + block


def run_length_bmp(width: int, height: int, runs: bytes) -> bytes:
    sizes = (40, width, height, 1, 8, 1, len(runs), 0, 0, 256, 0)
    head = b"BM" + struct.pack("<IHHI", 1078 + len(runs), 0, 0, 1078)
    return head + struct.pack("<IiiHHIIiiII", *sizes) + bytes(range(256)) * 4 + runs


def resized(content: bytes, form: str, old: tuple[int, int], new: tuple[int, int]) -> bytes:
    """A file whose header states another size."""
    before, after = struct.pack(form, *old), struct.pack(form, *new)
    assert before in content
    return content.replace(before, after, 1)


def lossless_webp(width: int, height: int) -> bytes:
    """A black picture: 34 bytes, whatever its size."""
    content = bytearray(saved(Image.new("RGBA", (16, 16)), "WEBP", lossless=True))
    (bits,) = struct.unpack_from("<I", content, 21)
    bits = bits & ~0xFFFFFFF | (width - 1) | (height - 1) << 14
    struct.pack_into("<I", content, 21, bits)
    return bytes(content)


def bombs() -> Iterator[tuple[str, bytes]]:
    """Small files that would take much memory or time."""
    nothing = chunk(b"IDAT", zlib.compress(bytes(1000)))
    text = b"hall\0\0" + zlib.compress(bytes(900_000), 9)
    for side in (13_000, 60_000, 2**31 - 1):
        yield f"declared_{side}.png", png(side, side, 8, 2, nothing)
    packed = chunk(b"IDAT", zlib.compress(bytes(13_000 * 1626), 9))
    yield "bomb.png", png(13_000, 13_000, 1, 0, packed)
    yield "texts.png", png(64, 48, 8, 2, *[chunk(b"zTXt", text)] * 80, nothing)
    profile = b"hall\0\0" + zlib.compress(bytes(50_000_000), 9)
    yield "profile.png", png(64, 48, 8, 2, chunk(b"iCCP", profile), nothing)
    yield "chunks.png", png(64, 48, 8, 2, *[chunk(b"huGe", b"")] * 20_000)
    flat = Image.new("L", (64, 48), 128)
    progressive = saved(flat, "JPEG", progressive=True)
    yield "declared.jpg", resized(progressive, ">HH", (48, 64), (65_500, 65_500))
    large = resized(progressive, ">HH", (48, 64), (10_000, 12_000))
    last = large.rindex(b"\xff\xc4", 0, large.rindex(b"\xff\xda"))  # its table and its scan
    yield "scans.jpg", large[:-2] + large[last:-2] * 3000 + large[-2:]
    yield "padding.jpg", b"\xff\xd8" + b"\xff" * 300_000
    yield "segments.jpg", b"\xff\xd8" + b"\xff\xe1\0\2" * 40_000
    yield "declared.tif", tiff(60_000, 60_000, [8, 8, 8], b"", rows=60_000)
    yield "one_strip.tif", tiff(9000, 9000, [8, 8, 8], b"123", rows=9000)
    yield "strips.tif", tiff(16, 30_000, [8, 8, 8], b"123", rows=1)
    yield "samples.tif", tiff(64, 48, [8] * 90, bytes(64 * 48 * 90), rows=48)
    head = b"II*\0" + struct.pack("<IH", 8, 65_535)
    entries = b"".join(struct.pack("<HHII", tag, 7, 200_000, 8) for tag in range(20_000))
    yield "tags.tif", head + entries
    yield "declared.gif", b"GIF89a" + struct.pack("<HHBBB", 65_535, 65_535, 0, 0, 0) + b";"
    frame = struct.pack("<HHBBBB4HB", 64, 48, 0, 0, 0, ord(","), 60_000, 60_000, 9, 9, 0)
    yield "frame.gif", b"GIF89a" + frame + b"\x08\1\0\0;"
    yield (
        "comments.gif",
        b"GIF89a" + struct.pack("<HHBBB", 64, 48, 0, 0, 0) + b"!\xfe\1a\0" * 20_000,
    )
    yield "bomb.webp", lossless_webp(12_200, 12_200)
    yield "canvas.webp", lossless_webp(16_384, 16_384)
    yield "runs.bmp", run_length_bmp(149_000_000, 1, b"\1\1\0\0\0\1")
    yield "jump.bmp", run_length_bmp(149_000_000, 1, b"\0\2\xff\xff\0\1")
    yield "text.pbm", b"P1 12000 12000\n" + b"1" * 1000
    yield "declared.pgm", b"P5 60000 60000 255\n"
    yield "declared.qoi", b"qoif" + struct.pack(">IIBB", 12_000, 12_000, 3, 0) + b"\xfd" * 99
    yield "loop.eps", b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 64 48\n%%EndComments\n{} loop\n"
    if features.check("jpg_2000"):
        found = saved(picture(), "JPEG2000")
        found = resized(found, ">II", (48, 64), (60_000, 60_000))
        yield "declared.jp2", resized(found, ">II", (64, 48), (60_000, 60_000))


def other_files() -> Iterator[tuple[str, bytes]]:
    yield "empty.jpg", b""
    yield "zeros.png", bytes(5000)
    yield "ones.jpg", b"\xff" * 5000
    yield "noise.webp", np.random.default_rng(8).bytes(5000)
    yield "text.jpg", b"This is no picture.\n" * 20
    yield "page.jpg", b"<!DOCTYPE html>\n<html><body>404</body></html>"
    yield "drawing.svg", b'<?xml version="1.0"?><svg xmlns="http://www.w3.org/2000/svg"/>'
    yield "values.json", b'{"image": [0, 1, 2]}'
    yield "paper.pdf", b"%PDF-1.7\n%\xe2\xe3\xcf\xd3\n1 0 obj\n<<>>\nendobj\n"
    yield "archive.png", b"PK\3\4\x14" + bytes(60)
    yield "program.jpg", b"\x7fELF\2\1\1" + bytes(200)
    yield "phone.heic", b"\0\0\0\x18ftypheic\0\0\0\0mif1heic" + bytes(200)
    yield "film.mp4", b"\0\0\0\x18ftypisom\0\0\0\0isommp42" + bytes(200)
    yield "light.exr", b"v/1\1\2\0\0\0" + bytes(200)
    yield "light.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 48 +X 64\n" + bytes(300)
    yield "table.h5", b"\x89HDF\r\n\x1a\n" + bytes(200)
    yield "film.mpg", b"\0\0\1\xb3\x04\0\x30" + bytes(200)
    yield "one.png", saved(picture(1, 1), "PNG")
    yield "low.png", saved(picture(20_000, 1), "PNG")
    yield "narrow.jpg", saved(picture(1, 20_000), "JPEG")
    yield "small.bmp", saved(picture(15, 16), "BMP")


Damage = Callable[[bytearray, np.random.Generator], bytes]


def cut(content: bytearray, rng: np.random.Generator) -> bytes:
    return bytes(content[: rng.integers(1, len(content))])


def flip(content: bytearray, rng: np.random.Generator) -> bytes:
    for place in rng.integers(0, len(content), int(np.exp(rng.uniform(0, np.log(200))))):
        content[place] ^= 1 << rng.integers(8)
    return bytes(content)


def swap(content: bytearray, rng: np.random.Generator) -> bytes:
    size = int(rng.integers(1, len(content) // 4))
    first, second = sorted(int(place) for place in rng.integers(0, len(content) - size, 2))
    a, b = content[first : first + size], content[second : second + size]
    content[first : first + size], content[second : second + size] = b, a
    return bytes(content)


def blank(content: bytearray, rng: np.random.Generator) -> bytes:
    """Zeros, or the ones of an erased memory card."""
    place, size = int(rng.integers(len(content))), int(rng.integers(1, 600))
    size = min(size, len(content) - place)
    content[place : place + size] = bytes([255 * rng.integers(2)]) * size
    return bytes(content)


def restate(content: bytearray, rng: np.random.Generator) -> bytes:
    """Other numbers in the header."""
    for _ in range(rng.integers(1, 4)):
        width = int(rng.choice([1, 2, 4]))
        place = int(rng.integers(4, min(300, len(content) - width)))
        value = rng.choice([bytes(width), b"\xff" * width, rng.bytes(width), b"\x7f" * width])
        content[place : place + width] = value[:width].ljust(width, b"\0")
    return bytes(content)


def append(content: bytearray, rng: np.random.Generator) -> bytes:
    return bytes(content) + rng.bytes(int(rng.integers(1, 3000)))


def splice(content: bytearray, rng: np.random.Generator) -> bytes:
    place = int(rng.integers(len(content)))
    return bytes(content[:place]) + rng.bytes(int(rng.integers(1, 50))) + bytes(content[place:])


DAMAGES: tuple[Damage, ...] = (cut, flip, restate, flip, swap, cut, blank, restate, append, splice)


def write_inputs(folder: Path) -> dict[str, bool | None]:
    """Write the files; the names of all, and whether they can be read (None: who knows)."""
    found: dict[str, bool | None] = {}

    def write(name: str, content: bytes, readable: bool | None) -> None:
        (folder / name).write_bytes(content)
        found[name] = readable

    for number, (name, (content, readable)) in enumerate(originals().items()):
        write(name, content, readable)
        stem, _, own = name.partition(".")
        other = SUFFIXES[number % len(SUFFIXES)]
        write(f"{stem}_{own}_renamed.{other}", content, readable)
        rng = np.random.default_rng(number)
        for copy in range(COPIES):
            damage = DAMAGES[copy % len(DAMAGES)]
            suffix = own if copy % 3 else str(rng.choice(SUFFIXES))
            damaged = damage(bytearray(content), rng)
            write(f"{stem}_{own}_{copy:02}_{damage.__name__}.{suffix}", damaged, None)
    for prefix, files in (("bomb", bombs()), ("other", other_files())):
        for name, content in files:
            write(f"{prefix}_{name}", content, False)
    found |= _odd_places(folder) | _odd_names(folder)
    return found


def _odd_places(folder: Path) -> dict[str, bool | None]:
    """What is no file, no longer one, or may not be read."""
    found: dict[str, bool | None] = dict.fromkeys(("missing.jpg", "folder.jpg", "large.jpg"), False)
    (folder / "folder.jpg").mkdir()
    with (folder / "large.jpg").open("wb") as file:
        file.truncate(600_000_000)  # of holes: it takes no room
    found["rgb.png/below.png"] = False  # a file where a folder would have to be
    found["n" * 300 + ".jpg"] = False
    if hasattr(os, "mkfifo"):
        os.mkfifo(folder / "pipe.jpg")
        links = {"gone.jpg": "nowhere", "loop.jpg": "loop.jpg", "null.jpg": "/dev/null"}
        links |= {"endless.jpg": "/dev/zero", "linked_folder.png": "folder.jpg"}
        for name, target in links.items():
            (folder / name).symlink_to(target)
        (folder / "linked.png").symlink_to("rgb.png")
        found |= dict.fromkeys(("pipe.jpg", *links), False) | {"linked.png": True}
    if hasattr(os, "geteuid") and os.geteuid() != 0:
        (folder / "locked.jpg").write_bytes((folder / "baseline.jpg").read_bytes())
        (folder / "locked.jpg").chmod(0)
        found["locked.jpg"] = False
    return found


def _odd_names(folder: Path) -> dict[str, bool | None]:
    whole = saved(picture(), "PNG")
    stems = ["two\nlines", "tab\tand space ", "-o", "ärger ❤ 写真", "100%s{0}", "\x1b[31mred"]
    stems.append(b"byte\xff".decode(errors="surrogateescape"))
    found: dict[str, bool | None] = {}
    for stem in stems:
        for name, content in ((f"{stem}.png", whole), (f"{stem}_cut.png", whole[:900])):
            try:
                (folder / name).write_bytes(content)
            except (OSError, ValueError):  # no name on this system
                continue
            found[name] = content is whole
    return found


def outcome(path: Path) -> dict[str, object]:
    """What becomes of one file, and the seconds of computing that it takes."""
    from fronto import InputError
    from fronto.camera import Camera
    from fronto.images import as_rgb
    from fronto.rectifier import photo_camera

    begin = time.process_time()
    found: dict[str, object] = {}
    try:
        image = as_rgb(path)
        assert image.dtype == np.uint8
        height, width, channels = image.shape
        assert channels == 3
        camera = photo_camera(path, width, height)
        assert (camera.width_px, camera.height_px) == (width, height)
        assert np.isfinite(camera.matrix).all()
        found["shape"] = image.shape
    except InputError as error:
        found["refusal"] = str(error)
    except BaseException:
        found["wrong"] = traceback.format_exc()
    if "refusal" in found:
        try:
            Camera.from_exif(path)  # which may still find something in the header
        except InputError:
            pass
        except BaseException:
            found["wrong"] = traceback.format_exc()
    return found | {"seconds": time.process_time() - begin}


def peak_bytes() -> int:
    """The most memory that this process has had so far."""
    status = Path("/proc/self/status")
    if status.exists():  # what getrusage tells on Linux begins with the parent's
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return 1024 * int(line.split()[1])
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def main(folder: Path) -> None:
    first = folder / "first.png"
    picture().save(first)
    outcome(first)  # what is imported first counts for no file
    first.unlink()
    before = peak_bytes()
    for name in json.loads(sys.stdin.read()):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            line = {"name": name} | outcome(folder / name)
        sys.stdout.write(json.dumps(line) + "\n")
        sys.stdout.flush()
    sys.stdout.write(json.dumps({"before": before, "peak": peak_bytes()}))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
