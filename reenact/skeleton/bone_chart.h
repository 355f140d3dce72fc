// A number for every place about a bone, by height along it and angle about it: how thick a part is, is a function of
// these. Pure.
#pragma once
#include "reenact/skeleton/bone_frame.h"

enum { CHART_HEIGHTS = 7, CHART_ANGLES = 12 };
#define CHART_MARGIN 0.5 // the chart goes on beyond the bone's ends, by so much of its length; the rest is its border's

struct bone_chart {
    float at[CHART_HEIGHTS * CHART_ANGLES];
};

// A place of a chart: the four numbers about it, and how much each has to say; these shares add up to 1.
struct chart_sample {
    int index[4];
    float weight[4];
};
struct chart_sample chart_sample_at(const struct bone_frame *bone, struct vec3 point); // the point in the frame's axes

float bone_chart_at(const struct bone_chart *chart, const struct chart_sample *place);
void bone_chart_add(struct bone_chart *chart, const struct chart_sample *place, float value); // parted among the four
double bone_chart_sum(const struct bone_chart *chart);

// A binomial over neighbours, all the way round; beyond the ends there is nothing.
void bone_chart_smooth(struct bone_chart *chart);
