"""The three backbones in PyTorch, layer by layer as `src/backbone` defines them, with torchvision's names."""

import torch
from torch import nn
from torch.nn import functional as F

EPSILON = 1e-3


class Layer(nn.Module):
    """Convolution, batch norm, activation."""

    def __init__(self, inputs, outputs, kernel, stride=1, padding=0, groups=1, activation=F.relu):
        super().__init__()
        self.conv = nn.Conv2d(inputs, outputs, kernel, stride, padding, groups=groups, bias=False)
        self.bn = nn.BatchNorm2d(outputs, eps=EPSILON)
        self.activation = activation

    def forward(self, x):
        return self.activation(self.bn(self.conv(x)), inplace=True)


def same(inputs, outputs, height=1, width=1):
    """A layer of stride 1 whose output is as large as its input."""
    return Layer(inputs, outputs, (height, width), padding=((height - 1) // 2, (width - 1) // 2))


class Branches(nn.Module):
    """Branches side by side, their channels one after the other."""

    def __init__(self, *branches):
        super().__init__()
        self.branches = nn.ModuleList(branches)

    def forward(self, x):
        return torch.cat([branch(x) for branch in self.branches], 1)


def block_a(inputs, pooled):
    return Branches(
        same(inputs, 64),
        nn.Sequential(same(inputs, 48), same(48, 64, 5, 5)),
        nn.Sequential(same(inputs, 64), same(64, 96, 3, 3), same(96, 96, 3, 3)),
        nn.Sequential(nn.AvgPool2d(3, 1, 1), same(inputs, pooled)),
    )


def block_b(inputs):
    return Branches(
        Layer(inputs, 384, 3, 2),
        nn.Sequential(same(inputs, 64), same(64, 96, 3, 3), Layer(96, 96, 3, 2)),
        nn.MaxPool2d(3, 2),
    )


def block_c(inputs, width):
    return Branches(
        same(inputs, 192),
        nn.Sequential(same(inputs, width), same(width, width, 1, 7), same(width, 192, 7, 1)),
        nn.Sequential(
            same(inputs, width),
            same(width, width, 7, 1),
            same(width, width, 1, 7),
            same(width, width, 7, 1),
            same(width, 192, 1, 7),
        ),
        nn.Sequential(nn.AvgPool2d(3, 1, 1), same(inputs, 192)),
    )


def block_d(inputs):
    return Branches(
        nn.Sequential(same(inputs, 192), Layer(192, 320, 3, 2)),
        nn.Sequential(same(inputs, 192), same(192, 192, 1, 7), same(192, 192, 7, 1), Layer(192, 192, 3, 2)),
        nn.MaxPool2d(3, 2),
    )


def block_e(inputs):
    return Branches(
        same(inputs, 320),
        nn.Sequential(same(inputs, 384), Branches(same(384, 384, 1, 3), same(384, 384, 3, 1))),
        nn.Sequential(
            same(inputs, 448), same(448, 384, 3, 3), Branches(same(384, 384, 1, 3), same(384, 384, 3, 1))
        ),
        nn.Sequential(nn.AvgPool2d(3, 1, 1), same(inputs, 192)),
    )


def inception_v3():
    return nn.Sequential(
        Layer(3, 32, 3, 2),
        Layer(32, 32, 3),
        same(32, 64, 3, 3),
        nn.MaxPool2d(3, 2),
        Layer(64, 80, 1),
        Layer(80, 192, 3),
        nn.MaxPool2d(3, 2),
        block_a(192, 32),
        block_a(256, 64),
        block_a(288, 64),
        block_b(288),
        *[block_c(768, width) for width in [128, 160, 160, 192]],
        block_d(768),
        block_e(1280),
        block_e(2048),
    )


class Bottleneck(nn.Module):
    """1 × 1, 3 × 3 (with the stride), 1 × 1, added to the input, which is projected where shapes differ."""

    def __init__(self, inputs, width, stride):
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, width, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(width, eps=EPSILON)
        self.conv2 = nn.Conv2d(width, width, 3, stride, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(width, eps=EPSILON)
        self.conv3 = nn.Conv2d(width, 4 * width, 1, bias=False)
        self.bn3 = nn.BatchNorm2d(4 * width, eps=EPSILON)
        self.downsample = None
        if inputs != 4 * width:
            projection = nn.Conv2d(inputs, 4 * width, 1, stride, bias=False)
            self.downsample = nn.Sequential(projection, nn.BatchNorm2d(4 * width, eps=EPSILON))

    def forward(self, x):
        y = F.relu(self.bn1(self.conv1(x)), inplace=True)
        y = F.relu(self.bn2(self.conv2(y)), inplace=True)
        y = self.bn3(self.conv3(y))
        y += x if self.downsample is None else self.downsample(x)
        return F.relu(y, inplace=True)


def resnet50():
    blocks, inputs = [], 64
    for stage, count in enumerate([3, 4, 6, 3]):
        for block in range(count):
            width = 64 << stage
            blocks.append(Bottleneck(inputs, width, 2 if stage > 0 and block == 0 else 1))
            inputs = 4 * width
    return nn.Sequential(Layer(3, 64, 7, 2, 3), nn.MaxPool2d(3, 2, 1), *blocks)


def mobilenet_v1():
    blocks, inputs = [Layer(3, 32, 3, 2, 1, activation=F.relu6)], 32
    widths = [64, 128, 128, 256, 256] + 6 * [512] + [1024, 1024]
    for outputs, stride in zip(widths, [1, 2, 1, 2, 1, 2, 1, 1, 1, 1, 1, 2, 1]):
        blocks.append(Layer(inputs, inputs, 3, stride, 1, groups=inputs, activation=F.relu6))
        blocks.append(Layer(inputs, outputs, 1, activation=F.relu6))
        inputs = outputs
    return nn.Sequential(*blocks)


class Pooled(nn.Module):
    """A backbone, the mean of its last map and, unless `outputs` is 0, a dense layer."""

    def __init__(self, name, outputs=0):
        super().__init__()
        make, channels = BACKBONES[name]
        self.backbone = make()
        self.head = nn.Linear(channels, outputs) if outputs else nn.Identity()
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight)

    def forward(self, x):
        return self.head(self.backbone(x).mean((2, 3)))


# function, channels of the last map
BACKBONES = {
    "inception_v3": (inception_v3, 2048),
    "resnet50": (resnet50, 2048),
    "mobilenet_v1": (mobilenet_v1, 1024),
}
