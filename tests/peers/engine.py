"""The work of `cargo bench --bench engine` in PyTorch, onnxruntime and OpenCV.

Without arguments it prints one JSON line with the versions of the libraries it found and the names of the works it
can do, then reads lines `WORK THREADS` and answers each with a JSON line: seconds of wall clock and of processor
time that it took. With `--peak WORK` it does the work once on one thread and prints the peak of its
memory, and how much it held before, in MiB. No library is imported that the work does not use.
"""

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time

BATCH = 16
TRAINING_BATCH = 8
HEAD_ROWS, HEAD_FEATURES, HEAD_LAYERS, HEAD_UNITS, HEAD_DROPOUT, HEAD_BATCH = 10_000, 2048, 6, 128, 0.2, 64
HEAD_EPOCHS = 2
PANORAMA_WIDTH, VIEW_PX, VIEWS = 2048, 299, 96
SIDES = {"inception_v3": 299, "resnet50": 224, "mobilenet_v1": 224}


def torch_extraction(name):
    import torch
    from backbones import Pooled

    model = Pooled(name).eval().to(memory_format=torch.channels_last)
    images = torch.rand(BATCH, 3, SIDES[name], SIDES[name]).contiguous(memory_format=torch.channels_last)

    def work(threads):
        torch.set_num_threads(threads)
        with torch.no_grad():
            model(images)

    return work


def torch_training_step(name):
    """Forward and backward pass of the mean squared error of two outputs, and a step of Adam."""
    import torch
    from backbones import Pooled

    model = Pooled(name, outputs=2).train().to(memory_format=torch.channels_last)
    optimiser = torch.optim.Adam(model.parameters(), lr=1e-4)
    images = torch.rand(TRAINING_BATCH, 3, SIDES[name], SIDES[name]).contiguous(memory_format=torch.channels_last)
    labels = torch.rand(TRAINING_BATCH, 2)

    def work(threads):
        torch.set_num_threads(threads)
        optimiser.zero_grad()
        torch.nn.functional.mse_loss(model(images), labels).backward()
        optimiser.step()

    return work


def torch_head():
    """Epochs of a head on features in memory, in shuffled batches."""
    import torch
    from torch import nn

    layers, inputs = [], HEAD_FEATURES
    for _ in range(HEAD_LAYERS):
        layers += [nn.Linear(inputs, HEAD_UNITS), nn.ReLU(), nn.Dropout(HEAD_DROPOUT)]
        inputs = HEAD_UNITS
    model = nn.Sequential(*layers, nn.Linear(inputs, 2)).train()
    optimiser = torch.optim.Adam(model.parameters(), lr=1e-3)
    features, labels = torch.rand(HEAD_ROWS, HEAD_FEATURES), torch.rand(HEAD_ROWS, 2)

    def work(threads):
        torch.set_num_threads(threads)
        for rows in (rows for _ in range(HEAD_EPOCHS) for rows in torch.randperm(HEAD_ROWS).split(HEAD_BATCH)):
            optimiser.zero_grad()
            torch.nn.functional.mse_loss(model(features[rows]), labels[rows]).backward()
            optimiser.step()

    return work


def onnx_export(name, path):
    import torch
    from backbones import Pooled

    images = torch.rand(BATCH, 3, SIDES[name], SIDES[name])
    torch.onnx.export(Pooled(name).eval(), (images,), path, input_names=["images"], dynamo=False)


def onnx_extraction(name):
    """PyTorch's model, exported to ONNX by a process of its own, with all of the runtime's graph optimisations."""
    import numpy as np
    import onnxruntime

    folder = tempfile.TemporaryDirectory()
    path = os.path.join(folder.name, "model.onnx")
    subprocess.run([sys.executable, "-W", "ignore", __file__, "--export", name, path], check=True)

    def session(threads, _keep=folder):
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        return onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])

    images = np.random.default_rng(1).random((BATCH, 3, SIDES[name], SIDES[name]), np.float32)
    sessions = {1: session(1)}

    def work(threads):
        if threads not in sessions:
            sessions[threads] = session(threads)
        sessions[threads].run(None, {"images": images})

    return work


def opencv_views():
    """Views of a panorama: rays of the unified camera model to azimuths and polar angles, then a bilinear remap."""
    import cv2
    import numpy as np

    generator = np.random.default_rng(1)
    panorama = generator.integers(0, 256, (PANORAMA_WIDTH // 2, PANORAMA_WIDTH, 3), np.uint8)
    places = np.arange(VIEW_PX, dtype=np.float32) + np.float32(0.5 - VIEW_PX / 2)
    angles = generator.uniform(-1.0, 1.0, (VIEWS, 2))

    def view(f, xi, yaw, pitch):
        x, y = np.meshgrid(places / np.float32(f), places / np.float32(f))
        r2 = x * x + y * y
        eta = (xi + np.sqrt(1 + (1 - xi * xi) * r2)) / (1 + r2)
        rays = np.stack([eta * x, eta * y, eta - xi])
        sy, cy, sp, cp = np.sin(yaw), np.cos(yaw), np.sin(pitch), np.cos(pitch)
        turn = np.array([[cy, sy * sp, sy * cp], [0, cp, -sp], [-sy, cy * sp, cy * cp]], np.float32)
        x, y, z = (turn @ rays.reshape(3, -1)).reshape(3, VIEW_PX, VIEW_PX)
        column = (np.arctan2(x, z) / np.float32(2 * np.pi) + np.float32(0.5)) * PANORAMA_WIDTH - np.float32(0.5)
        polar = np.arctan2(np.sqrt(x * x + z * z), -y)
        row = polar / np.float32(np.pi) * (PANORAMA_WIDTH // 2) - np.float32(0.5)
        return cv2.remap(panorama, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)

    def work(threads):
        cv2.setNumThreads(threads)
        for i, (yaw, pitch) in enumerate(angles):
            camera = i % 8
            view(np.float32(60 + 30 * camera), np.float32(0.1 * camera), np.pi * yaw, 0.5 * pitch)

    return work


def works():
    """Name of each work that the libraries allow, and the function that prepares it."""
    makers = {}
    for name in SIDES if found("torch") else []:
        makers[f"torch/extraction/{name}"] = lambda name=name: torch_extraction(name)
        makers[f"torch/training/{name}"] = lambda name=name: torch_training_step(name)
        if found("onnxruntime", "onnx", "numpy"):
            makers[f"onnxruntime/extraction/{name}"] = lambda name=name: onnx_extraction(name)
    if found("torch"):
        makers["torch/head"] = torch_head
    if found("cv2", "numpy"):
        makers["opencv/views"] = opencv_views
    return makers


def found(*names):
    return all(importlib.util.find_spec(name) for name in names)


def versions():
    names = {"torch": "torch", "onnxruntime": "onnxruntime", "opencv": "cv2", "numpy": "numpy"}
    return {key: importlib.import_module(name).__version__ for key, name in names.items() if found(name)}


def memory(key):
    """A line of /proc/self/status, in MiB."""
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith(key)) / 1024


def print_peak(name):
    work = works()[name]()
    before = memory("VmRSS:")
    work(1)
    print(json.dumps({"peak_mib": memory("VmHWM:"), "before_mib": before}))


def serve():
    makers, prepared = works(), {}
    print(json.dumps({"versions": versions(), "works": list(makers)}), flush=True)
    for line in sys.stdin:
        name, threads = line.split()
        if name not in prepared:
            prepared[name] = makers[name]()
        begun, used = time.perf_counter(), time.process_time()
        prepared[name](int(threads))
        answer = {"seconds": time.perf_counter() - begun, "cpu_seconds": time.process_time() - used}
        print(json.dumps(answer), flush=True)


def main():
    match sys.argv[1:]:
        case ["--peak", name]:
            print_peak(name)
        case ["--export", name, path]:
            onnx_export(name, path)
        case _:
            serve()


if __name__ == "__main__":
    main()
