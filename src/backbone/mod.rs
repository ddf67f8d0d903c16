//! Convolutional backbones — Inception-V3, ResNet50, MobileNet-V1 — and their weights.
