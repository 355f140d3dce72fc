// joints-csv, the text format of joints over time, as all programs here write it:
//
//     # axes: camera
//     timestamp,joint,x_m,y_m,z_m,confidence,sigma_m
//     7.100000,head,0.01200,-0.61000,3.10000,1.00,0.02100
//
// Seconds and metres; confidence as in skeleton.h; sigma_m, the standard deviation per axis, is empty where it is not
// known, and the column may be missing. The first line says the axes. Files of other programs lack it: their reader
// (compare/joint_samples.h) finds the axes out.
#pragma once
#include "recording/skeleton.h"

#include <stdio.h>

enum joints_csv_axes {
    JOINTS_CSV_CAMERA, // x right, y down, z forward
    JOINTS_CSV_ROOM,   // z up; right-handed, too
    JOINTS_CSV_AXES
};
extern const char *const joints_csv_axes_names[JOINTS_CSV_AXES]; // "camera", "room"

#define JOINTS_CSV_MARK   "# axes:"
#define JOINTS_CSV_HEADER "timestamp,joint,x_m,y_m,z_m,confidence"
#define JOINTS_CSV_SIGMA  ",sigma_m"

void joints_csv_begin(FILE *out, enum joints_csv_axes axes);                      // the lines before the first row
void joints_csv_add(FILE *out, int64_t time_ns, const struct skeleton *skeleton); // a row for each joint
