// Export of a take's joints for other programs: CSV, and BVH (Biovision hierarchy). Pure but for the file written.
#pragma once
#include "capture/recording/recording.h"

// CSV: timestamp,joint,x_m,y_m,z_m,confidence,sigma_m; seconds, the colour camera's axes; sigma_m: standard deviation
// per axis, empty where not known. Frames without a person left out. Written whole or not at all. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status export_joints_csv(const struct take *take, const char *path);

// BVH, y up, centimetres: bones of the take's median lengths, rotated frame by
// frame; frames without a person left out. In the world's axes where the sensor
// was located, else in the camera's. Written whole or not at all. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status export_bvh(const struct take *take, const char *path);
