# SPDX-License-Identifier: BSD-3-Clause
"""Networks that label cars in images (docs/benchmarks/labels.md): on rendered images of two domains beside the grid
paper's Table III, and on photos with boxes. Run by scripts/evaluate.

The rendered images are drawn first, from scenes that no network was trained on. Photos are a folder with labels.json,
{FILE: {"scene", "width", "height", "boxes": [{"class", "x0", "y0", "x1", "y1"}]}}, edges in px."""

import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
from matplotlib import image as image_files

import printed
from pictures import clean, images_folder, pyplot, save
from report import (ROOT, arguments_parser, facts, introduction, output_folder, prose, run_pieces, section, table,
                    targets_section, write)

sys.path.insert(0, str(ROOT / "scripts/train"))
import image_scenes  # noqa: E402

STRIDE, MULTIPLE = 16, 32
SCENES, POSES, SEED = 40, 6, 2  # networks are trained on seed 1
SEEN, UNSEEN, WORLD = "town", "field", "carpark"  # the last is models/worlds/carpark.xml
WORLD_FOV_RAD = 1.0
NETWORKS = {  # shipped file: (name, row of Table III)
    "fcn_vgg16_town": ("FCN-VGG16, an eighth of the filters", "fcn_vgg16"),
    "scoutnet_town": ("ScoutNet, a quarter of the filters", "scoutnet"),
    "scoutnet_v0_town": ("ScoutNet v0, half of ScoutNet's", "scoutnet_v0"),
}
BOTH, BOTH_NAME = "scoutnet", "ScoutNet, trained on both"
NAMES = {network: name for network, (name, _) in NETWORKS.items()} | {BOTH: BOTH_NAME}
SIZES = (224, 320, 448, 640, 896)
TIMED = 12  # images for each size
LARGEST_MS = 60.0  # of ScoutNet at 448
PHOTO_CARS, PHOTO_OUTSIDE = 50.0, 20.0  # per cent: found, and labelled pixels outside all boxes
THRESHOLD = 0.5
THRESHOLDS = (0.1, 0.2, 0.3, 0.4, 0.5)
BINS = np.array((0.0, 0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0 + 1e-9))
CAR, OTHERS = ("car", "minibus"), ("truck", "bus", "cyclist")
TRAINED_SCENES = ("komarovka crossing, overcast", "komarovka crossing, photos")  # of the network that saw photos
SMALL_PX = 50  # where cars have a shorter median diagonal, photos are also enlarged
COLORS = {"fcn_vgg16_town": "#7f95b2", "scoutnet_town": "#0b6e4f", "scoutnet_v0_town": "#c8553d", BOTH: "#8a5a83"}


# --- labels


def read_netpbm(path):
    content = np.fromfile(path, np.uint8)
    kind, width, height, _ = content[:32].tobytes().split(maxsplit=4)[:4]
    size = int(height), int(width), *((3,) if kind == b"P6" else ())
    return content[-int(np.prod(size)):].reshape(size)


def write_ppm(path, rgb):
    path.write_bytes(b"P6\n%d %d\n255\n" % (rgb.shape[1], rgb.shape[0]) + np.ascontiguousarray(rgb).tobytes())


def area_weights(fine, coarse):
    """coarse x fine: means over equal parts of a line."""
    edges = np.linspace(0, fine, coarse + 1)
    pixels = np.arange(fine)
    overlap = np.minimum(edges[1:, None], pixels + 1) - np.maximum(edges[:-1, None], pixels)
    return np.maximum(overlap, 0.0) * coarse / fine


def cover(labels, shape):
    """How much of each label pixel is a car, from labels of 0 or 255."""
    rows, columns = (area_weights(fine, coarse) for fine, coarse in zip(labels.shape, shape))
    return rows @ (labels / 255.0) @ columns.T


def label(arguments, model, paths, width, height, out):
    """The probabilities for each image, and the milliseconds."""
    command = [arguments.tool, "--model", model, "--width", str(width), "--height", str(height), "--out", out, *paths]
    lines = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()
    answers = [read_netpbm(pathlib.Path(out) / (path.stem + ".pgm")) / 255.0 for path in paths]
    return answers, [float(line.rsplit(" ", 1)[1]) for line in lines]


def scores(answers, covers, threshold=THRESHOLD):
    """(IoU, precision, recall) in per cent over the label pixels of all images."""
    says = np.concatenate([answer.ravel() for answer in answers]) > threshold
    true = np.concatenate([part.ravel() for part in covers]) > 0.5
    both = (says & true).sum()
    return 100 * both / max(1, (says | true).sum()), 100 * both / max(1, says.sum()), 100 * both / max(1, true.sum())


def shown(values):
    return [f"{value:.1f}" for value in values]


# --- rendered images


def draw_images(arguments, domain, folder):
    """Those of a domain, drawn where they are not there."""
    program = arguments.programs / "image_samples"
    folder.mkdir(parents=True, exist_ok=True)
    pieces = {number: (program.resolve(), domain, SEED, number, POSES, folder) for number in range(arguments.scenes)
              if not (folder / f"{number:05d}_{POSES - 1:04d}.pgm").exists()}
    if pieces:
        run_pieces(image_scenes.draw_scene, pieces, f"scenes of {domain} drawn")
    return sorted(folder.glob("*.ppm"))[: arguments.scenes * POSES]


def draw_world(arguments, folder):
    """Images of the demo's world, from poses as those of the domains, looking towards its middle."""
    random = np.random.default_rng(SEED)
    folder.mkdir(parents=True, exist_ok=True)
    lines = []
    for _ in range(arguments.scenes * POSES // 2):
        x, y = random.uniform(-70, 70, 2)
        yaw = np.arctan2(-y, -x) + random.normal(0, 0.5)
        height, pitch = random.uniform(28, 45), -np.radians(random.uniform(15, 35))  # its hills are up to 9 m
        lines.append(f"{x:.3f} {y:.3f} {height:.3f} {yaw:.4f} {pitch:.4f} {random.normal(0, 0.05):.4f}\n")
    poses = folder / "poses"
    poses.write_text("".join(lines))
    size = str(image_scenes.IMAGE_PX)
    subprocess.run([arguments.programs / "image_samples", "--world", ROOT / f"models/worlds/{WORLD}.xml",
                    "--poses", poses, "--fovy", str(WORLD_FOV_RAD), "--width", size, "--height", size,
                    "--out", f"{folder}/"], check=True)
    return sorted(folder.glob("*.ppm"))


def rendered_results(arguments, images, work):
    """{(network, domain): (answers, covers)} at the images' own size."""
    results = {}
    for domain, paths in images.items():
        covers = None
        for network in (*NETWORKS, BOTH):
            size = image_scenes.IMAGE_PX
            answers, _ = label(arguments, arguments.models / f"{network}.onnx", paths, size, size, work / network)
            covers = covers or [cover(read_netpbm(path.with_suffix(".pgm")), answers[0].shape) for path in paths]
            results[network, domain] = answers, covers
    return results


def rendered_table(results, rows_of_paper):
    rows = []
    for network, (name, row) in NETWORKS.items():
        rows.append([name] + [text for domain in (SEEN, UNSEEN, WORLD)
                              for text in shown(scores(*results[network, domain]))] +
                    [rows_of_paper[row, data][key] for data in ("MAVCAR", "FIELD")
                     for key in ("iou", "precision", "recall")])
    ours = [scores(*results[BOTH, domain]) for domain in (SEEN, UNSEEN, WORLD)]
    rows.append([BOTH_NAME] + [text for values in ours for text in shown(values)] + [""] * 6)
    data = (f"{SEEN} (seen)", f"{UNSEEN} (unseen)", WORLD, "MAVCAR, printed", "FIELD, printed")
    header = ["network"] + [f"{domain} {what}" for domain in data for what in ("IoU", "P", "R")]
    return table(header, rows)


def calibration_table(results):
    rows = []
    for network, domain in [(network, domain) for network in (BOTH, "scoutnet_town")
                            for domain in (SEEN, UNSEEN, WORLD)]:
        answers, covers = (np.concatenate([part.ravel() for part in parts]) for parts in results[network, domain])
        row = [f"{NAMES[network]}: {domain}"]
        for low, high in zip(BINS[:-1], BINS[1:]):
            which = (answers >= low) & (answers < high)
            row.append(f"{answers[which].mean():.2f}: {covers[which].mean():.2f}" if which.any() else "")
        rows.append(row)
    return table(["network: domain"] + [f"{low:.2f} to {min(high, 1):.2f}" for low, high in zip(BINS[:-1], BINS[1:])],
                 rows)


def thresholds_table(results):
    rows = [[NAMES[network], domain] + [f"{scores(*results[network, domain], threshold)[0]:.1f}"
                                        for threshold in THRESHOLDS]
            for network in NAMES for domain in (SEEN, UNSEEN, WORLD)]
    return table(["network", "domain"] + [f"{threshold:g}" for threshold in THRESHOLDS], rows)


def by_size(arguments, images, work):
    """{(network, size): (milliseconds, IoU of the unseen domain)}: images scaled to the size."""
    results = {}
    paths = images[UNSEEN]
    for network in NETWORKS:
        for size in SIZES:
            model = arguments.models / f"{network}.onnx"
            answers, _ = label(arguments, model, paths[::4], size, size, work / "sizes")
            covers = [cover(read_netpbm(path.with_suffix(".pgm")), answers[0].shape) for path in paths[::4]]
            _, times = label(arguments, model, paths[:TIMED], size, size, work / "times")
            results[network, size] = float(np.median(times[2:])), scores(answers, covers)[0]
    return results


def draw_examples(results, images, path, network):
    """Per domain the images of the best, a middle and the worst IoU of those with cars."""
    figure, axes = pyplot.subplots(3, 5, figsize=(15, 9.6))
    for row, domain in zip(axes, (SEEN, UNSEEN, WORLD)):
        answers, covers = results[network, domain]
        with_cars = [i for i, part in enumerate(covers) if (part > 0.5).sum() >= 2]
        order = sorted(with_cars, key=lambda i: scores([answers[i]], [covers[i]])[0])
        for ax, place in zip(row, (0.95, 0.75, 0.5, 0.25, 0.03)):
            i = order[int(place * (len(order) - 1))]
            rgb = read_netpbm(images[domain][i])
            edges = (-0.5, rgb.shape[1] - 0.5, rgb.shape[0] - 0.5, -0.5)
            ax.imshow(rgb, extent=edges)
            tint = np.zeros((*answers[i].shape, 4))
            tint[..., 0] = tint[..., 2] = 1.0
            tint[..., 3] = 0.7 * answers[i]
            ax.imshow(tint, extent=edges, interpolation="nearest")
            centers = (np.arange(answers[i].shape[0]) + 0.5) * rgb.shape[0] / answers[i].shape[0] - 0.5
            if (covers[i] > 0.5).any():
                ax.contour(centers, centers, covers[i], levels=[0.5], colors="#00e5ff", linewidths=0.9)
            ax.set_title(f"{domain}, IoU {scores([answers[i]], [covers[i]])[0]:.0f} %", fontsize=9)
            ax.set_axis_off()
    save(figure, path)


def draw_sizes(sizes, path):
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
    for network, (name, _) in NETWORKS.items():
        for ax, which in ((left, 0), (right, 1)):
            ax.plot(SIZES, [sizes[network, size][which] for size in SIZES], "o-", color=COLORS[network], label=name)
    left.set(yscale="log", xlabel="input, px", ylabel="ms per image, one core", xticks=SIZES)
    right.set(xlabel="input, px", ylabel=f"IoU of {UNSEEN}, %", xticks=SIZES, ylim=(0, None))
    for ax in (left, right):
        clean(ax)
    left.legend(frameon=False, fontsize=8)
    save(figure, path)


# --- photos


def photo_scores(arguments, model, names, photos, scale, work):
    """Cars; those with a labelled pixel inside their box; labelled pixels; those outside all boxes, and by more than a
    label pixel. A pixel is where its centre is."""
    cars = found = labelled = outside = far = 0
    for name in names:
        photo = photos[name]
        ppm = work / (pathlib.Path(name).stem + ".ppm")
        if not ppm.exists():
            write_ppm(ppm, image_files.imread(arguments.data / name)[..., :3])
        width, height = (max(MULTIPLE, MULTIPLE * round(scale * photo[key] / MULTIPLE)) for key in ("width", "height"))
        (answer,), _ = label(arguments, model, [ppm], width, height, work / "labels")
        row, column = np.nonzero(answer > THRESHOLD)
        x = (column + 0.5) * photo["width"] / answer.shape[1]
        y = (row + 0.5) * photo["height"] / answer.shape[0]
        step_x, step_y = photo["width"] / answer.shape[1], photo["height"] / answer.shape[0]
        inside_any, near_any = np.zeros((2, len(x)), bool)
        for box in photo["boxes"]:
            inside = (x >= box["x0"]) & (x <= box["x1"]) & (y >= box["y0"]) & (y <= box["y1"])
            inside_any |= inside
            near_any |= ((x >= box["x0"] - step_x) & (x <= box["x1"] + step_x) &
                         (y >= box["y0"] - step_y) & (y <= box["y1"] + step_y))
            if box["class"] in CAR:
                cars += 1
                found += bool(inside.any())
        labelled += len(x)
        outside += int((~inside_any).sum())
        far += int((~near_any).sum())
    return cars, found, labelled, outside, far


def photo_table(arguments, work):
    """The table, and for each file of a network the counts of photo_scores for the held-out half."""
    photos = json.loads((arguments.data / "labels.json").read_text())
    scenes = sorted({photo["scene"] for photo in photos.values()})
    models = [(BOTH_NAME.replace("both", "both rendered domains"), arguments.models / f"{BOTH}.onnx"),
              ("the same, trained on town alone", arguments.models / "scoutnet_town.onnx")]
    if arguments.with_photos:
        models.append(("ScoutNet that also saw half of the photos", arguments.with_photos))
    rows, counts = [], {}
    for name, model in models:
        found = {}
        for scene in scenes:
            names = [photo for photo in sorted(photos) if photos[photo]["scene"] == scene]
            diagonal_px = np.median([np.hypot(box["x1"] - box["x0"], box["y1"] - box["y0"])
                                     for photo in names for box in photos[photo]["boxes"] if box["class"] in CAR])
            found[scene, 1] = photo_scores(arguments, model, names, photos, 1, work)
            if diagonal_px < SMALL_PX:
                found[scene, 2] = photo_scores(arguments, model, names, photos, 2, work)
        held_out = [(scene, 1) for scene in scenes if scene not in TRAINED_SCENES]
        counts[model] = np.sum([found[key] for key in held_out], axis=0)
        seen = "seen" if model == arguments.with_photos else "not seen"
        for title, keys in [("the held-out half", held_out)] + [
                (f"{scene}{' (' + seen + ')' if scene in TRAINED_SCENES else ''}", [(scene, scale)])
                for scene, scale in sorted(found, key=lambda key: (key[0] in TRAINED_SCENES, key))]:
            cars, hit, labelled, outside, far = np.sum([found[key] for key in keys], axis=0)
            rows.append((name, f"{keys[0][1]}", title, f"{cars}", f"{100 * hit / max(1, cars):.1f}", f"{labelled}",
                         f"{100 * outside / max(1, labelled):.1f}", f"{100 * far / max(1, labelled):.1f}"))
    return table(("network", "scale", "scene", "cars", "with a labelled pixel in their box, %", "labelled pixels",
                  "of these outside all boxes, %", "by more than a label pixel, %"), rows), counts


# --- report


def main():
    parser = arguments_parser(__doc__, "docs/benchmarks")
    parser.add_argument("--tool", type=pathlib.Path, required=True)
    parser.add_argument("--programs", type=pathlib.Path, required=True)
    parser.add_argument("--models", type=pathlib.Path, default=ROOT / "models")
    parser.add_argument("--scenes", type=int, default=SCENES, help="of each domain")
    parser.add_argument("--images", type=pathlib.Path, default=ROOT / "build/evaluation/drawn_images",
                        help="where the drawn images are kept")
    parser.add_argument("--data", type=pathlib.Path, default=ROOT.parent / "shared/data/aerial_cars", help="photos")
    parser.add_argument("--with-photos", type=pathlib.Path,
                        help="a network that was trained on half of the photos, too")
    arguments = parser.parse_args()
    output = output_folder(arguments, arguments.scenes == SCENES)
    measured = facts(arguments, {"--with-photos": "FILE", "--data": "DIR", "--images": "DIR"})
    rows_of_paper = {(row["network"], row["data"]): row for row in
                     printed.read_rows(printed.DATA / "grid_paper_labels.csv")}
    with tempfile.TemporaryDirectory() as folder:
        work = pathlib.Path(folder)
        images = {domain: draw_images(arguments, domain, arguments.images / domain) for domain in (SEEN, UNSEEN)}
        images[WORLD] = draw_world(arguments, arguments.images / WORLD)
        results = rendered_results(arguments, images, work)
        sizes = by_size(arguments, images, work)
        photos, photo_counts = (photo_table(arguments, work) if (arguments.data / "labels.json").exists() else ("", {}))
    pictures = images_folder(output)
    draw_examples(results, images, pictures / "labels_rendered.png", "scoutnet_town")
    draw_sizes(sizes, pictures / "labels_sizes.png")
    iou = {key: scores(*value)[0] for key, value in results.items()}
    time_ms = sizes["scoutnet_town", 448][0]
    verdicts = [(f"ScoutNet at 448 px in at most {LARGEST_MS:g} ms on one core", f"{time_ms:.0f} ms",
                 time_ms <= LARGEST_MS),
                ("unseen domain: IoU of v0 below ScoutNet's",
                 f"{iou['scoutnet_v0_town', UNSEEN]:.1f} and {iou['scoutnet_town', UNSEEN]:.1f} %",
                 iou["scoutnet_v0_town", UNSEEN] < iou["scoutnet_town", UNSEEN])]
    for domain in images:
        ours, baseline = iou["scoutnet_town", domain], iou["fcn_vgg16_town", domain]
        verdicts.append((f"{domain}: IoU of ScoutNet at least that of the baseline, FCN-VGG16, on the same images",
                         f"{ours:.1f} and {baseline:.1f} %", ours >= baseline))
    if photos:
        cars, hit, labelled, outside, _ = photo_counts[arguments.models / f"{BOTH}.onnx"]
        found, false = 100 * hit / max(1, cars), 100 * outside / max(1, labelled)
        verdicts += [(f"photos, held-out half, the default network: at least {PHOTO_CARS:g} % of the cars have a "
                      "labelled pixel", f"{found:.1f} %", found >= PHOTO_CARS),
                     (f"photos, held-out half, the default network: at most {PHOTO_OUTSIDE:g} % of the labelled pixels "
                      "are outside all boxes", f"{false:.1f} %", false <= PHOTO_OUTSIDE)]
    with_photos = ("The network that also saw photos was trained on the scenes marked as seen, half of the 73, which are "
                   "of the same crossing as the held-out sunny video; Munich is another place. It is not shipped. "
                   if arguments.with_photos else "")
    report = "\n".join((
        "# Labels of images, measured\n",
        introduction(measured, f"Networks label an image at a 16th of its size: ScoutNet, its lighter version v0 and "
                     f"FCN-VGG16 of the grid paper, with the widths of Darknet-19 and VGG16 times a factor, trained on "
                     f"images that MuJoCo draws ([math/labels.md](../math/labels.md)). The paper's images are not to be "
                     f"had: its columns stand beside ours as a substitute, and say nothing of which is better; targets compare "
                     f"networks on the same images alone."),
        targets_section(verdicts),
        section("Rendered images: the columns of Table III", prose(
            f"Per cent of label pixels: IoU, precision (P), recall (R), over {len(images[SEEN])} images of "
            f"{image_scenes.IMAGE_PX} px of {arguments.scenes} scenes of each domain. A pixel is a car where at least "
            "half of it is one in the drawn image, and where the network's probability is above .5. The first three "
            f"networks are trained on other scenes of `{SEEN}` alone, the last, which is the default, on scenes of both "
            f"domains. No network saw anything of `{WORLD}`, the world of the demo, which has hills and cars of other shapes."),
            rendered_table(results, rows_of_paper),
            "![Rendered images with labels](images/labels_rendered.png)\n", prose(
            "*ScoutNet trained on `town`: its probability in magenta, the truth outlined; images at 95, 75, 50, 25 and 3 % of "
            "the order of their IoU.*"),
            prose("Probability that a pixel is said to be a car, mean of those in the interval: how much of these "
                  "pixels is a car. Training is on the covered part of each label pixel, so the two should agree."),
            calibration_table(results), prose(
            "Where a domain was not seen, the best threshold may be another one than .5. IoU, in per cent, where a pixel "
            "is called a car above another probability:"),
            thresholds_table(results)),
        section("Time and image size", prose(
            f"Median of {TIMED - 2} images on one core, scaling included, and IoU of `{UNSEEN}`, every fourth image "
            f"scaled from {image_scenes.IMAGE_PX} px, with the truth at the scaled size."),
            table(["network"] + [f"{size} px" for size in SIZES],
                  [[name] + [f"{sizes[network, size][0]:.0f} ms, {sizes[network, size][1]:.0f} %" for size in SIZES]
                   for network, (name, _) in NETWORKS.items()]),
            "![Time and IoU by size](images/labels_sizes.png)\n"),
        section("Photos", prose(
            "73 photos and frames of videos from drones and of a street in Munich, with boxes around cars "
            "(jekhor/aerial-cars-dataset; DJI images © Yauhen Kharuzhy and Minsk OSM community, CC-BY-SA; Munich: KIT AIS "
            "Data Set, CC-BY 3.0), most straight down from about 100 m, which the paper's are not: its FIELD columns, "
            "precision 79.4 and recall 37.9 % for ScoutNet, count pixels of masks. Cars and minibuses count as cars; a "
            "labelled pixel inside a box of any kind of vehicle is not outside. Some cars have no box, and no masks "
            "exist, so that this is neither precision nor recall. " + with_photos + "The scale is that from the photo of "
            "1600 px to the network's input: at 2 the cars of Munich are as large as rendered ones seen from 40 m."),
            photos) if photos else "",
    ))
    write(output, "labels.md", report)


if __name__ == "__main__":
    main()
