// A bone chart: a scalar field on the surface about a bone, over height along it and angle about it (as the thickness
// of a body part is), on a 7 x 12 grid with bilinear interpolation. Pure.
#pragma once
#include "reenact/skeleton/bone_frame.h"

enum { CHART_HEIGHTS = 7, CHART_ANGLES = 12 };
#define CHART_MARGIN 0.5 // the chart extends beyond both ends by this share of the bone's length; then it is clamped

struct bone_chart {
    float at[CHART_HEIGHTS * CHART_ANGLES]; // [height][angle]
};

// A point of a chart: the four grid values about it and their bilinear weights, which add up to 1.
struct chart_sample {
    int index[4];
    float weight[4];
};
struct chart_sample chart_sample_at(const struct bone_frame *bone,
                                    struct vec3 point); // in the bone frame's skeleton's axes

float bone_chart_at(const struct bone_chart *chart, const struct chart_sample *sample);
void bone_chart_add(struct bone_chart *chart, const struct chart_sample *sample, float value); // by its weights
double bone_chart_sum(const struct bone_chart *chart);

// 3 x 3 binomial filter, cyclic in the angle; zero beyond the first and last height.
void bone_chart_smooth(struct bone_chart *chart);
