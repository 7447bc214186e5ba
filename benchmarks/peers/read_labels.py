"""Reads every PNG of a folder with RapidOCR's recogniser; runs in an environment of its own.

    python read_labels.py FOLDER OUT.json       {file name: [text, score 0 to 1]}

Recognition alone: each picture is one line of text, upright. The network is the one inside the
wheel, and nothing is downloaded.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import cv2
import rapidocr

MODEL = Path(rapidocr.__file__).parent / "models" / "PP-OCRv6_rec_small.onnx"
BATCH = 6
#: Channels, height and least width. Its usual 320 pads a button's two digits to four times the
#: work, and reads as many of them.
SHAPE = (3, 48, 48)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    arguments = parser.parse_args()
    recogniser = rapidocr.RapidOCR(
        params={
            "Global.use_det": False,
            "Global.use_cls": False,
            "Global.log_level": "error",
            # Given the file, it neither looks for another nor asks a server.
            "Rec.model_path": str(MODEL),
            "Rec.rec_batch_num": BATCH,
            "Rec.rec_img_shape": list(SHAPE),
        }
    )
    paths = sorted(arguments.folder.glob("*.png"))
    read = {}
    if paths:
        found = recogniser.recognize_txt([cv2.imread(str(path)) for path in paths])
        for path, text, score in zip(paths, found.txts, found.scores, strict=True):
            read[path.name] = [text, float(score)]
    arguments.out.write_text(json.dumps(read, ensure_ascii=False), encoding="utf-8")


if __name__ == "__main__":
    main()
