// Models of a structured-light sensor's depth noise, one named function each. Pure.
//
// The random error of a depth sample grows with the square of its depth, because depth is inversely proportional to
// the measured disparity: sigma = 1.5e-3 z^2 (Khoshelham and Elberink, Sensors 2012, for the Kinect). z in metres
// along the optical axis.
#pragma once
#include <stdint.h>

// Standard deviation of one depth sample against the surface, metres: random noise alone. For comparing samples of one
// sensor with each other.
static inline double depth_sigma_m(double z_m) { return 1.5e-3 * z_m * z_m; }

// The same against metric truth: 1 mm more for what does not shrink near the sensor (calibration, quantisation). For
// weights of depth in poses, where a sigma near 0 would let depth outweigh the image.
static inline double depth_absolute_sigma_m(double z_m) { return 1.5e-3 * z_m * z_m + 1e-3; }

// How far two samples of one surface may differ, metres: three standard deviations of their difference.
static inline double depth_difference_m(double z_m) { return 3 * 1.4142 * depth_sigma_m(z_m); }

// The same in millimetres for a depth in millimetres, between views of a mapped room: 20 mm more for the map's error.
static inline double depth_between_views_mm(double mm) { return 3 * 1.4142 * 1.5e-6 * mm * mm + 20; }

// How far neighbouring pixels of one limb may differ, metres: four standard deviations of one sample, and a slope of
// 60 degrees over a pixel at f = 525.
static inline double depth_limb_step_m(double z_m) { return 4 * depth_sigma_m(z_m) + 0.0033 * z_m + 0.005; }

// How far neighbouring samples of one surface may differ because depth is quantised, millimetres: the sensor's steps
// grow with the square of the depth too (45 mm at 4 m for a Kinect), and noise makes two or three of them.
static inline int depth_step_mm(int depth_mm) { return (int)((int64_t)depth_mm * depth_mm / 160000); }
