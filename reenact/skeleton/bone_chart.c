// Bilinear lookup, accumulation and smoothing of bone charts.
#include "reenact/skeleton/bone_chart.h"
#include "base/portable_math.h"

struct chart_sample chart_sample_at(const struct bone_frame *bone, struct vec3 point)
{
    const struct vec3 in = bone_frame_local_point(bone, point);
    const double margin = CHART_MARGIN, rows = CHART_HEIGHTS - 1;
    const double along = (in.z / bone->length + margin) / (1 + 2 * margin) * rows;
    const double height = along > 0 ? fmin(along, rows) : 0;
    const double angle = (portable_atan2(in.x, in.y) / 6.283185307179586 + 1) * CHART_ANGLES; // > 0
    const int row = height < rows ? (int)height : CHART_HEIGHTS - 2, column = (int)angle;
    struct chart_sample sample;
    for (int k = 0; k < 4; k++) {
        const double up = k >> 1 ? height - row : 1 - (height - row),
                     round = k & 1 ? angle - column : 1 - (angle - column);
        sample.index[k] = (row + (k >> 1)) * CHART_ANGLES + (column + (k & 1)) % CHART_ANGLES;
        sample.weight[k] = (float)(up * round);
    }
    return sample;
}

float bone_chart_at(const struct bone_chart *chart, const struct chart_sample *sample)
{
    float sum = 0;
    for (int k = 0; k < 4; k++)
        sum += sample->weight[k] * chart->at[sample->index[k]];
    return sum;
}

void bone_chart_add(struct bone_chart *chart, const struct chart_sample *sample, float value)
{
    for (int k = 0; k < 4; k++)
        chart->at[sample->index[k]] += sample->weight[k] * value;
}

double bone_chart_sum(const struct bone_chart *chart)
{
    double sum = 0;
    for (int i = 0; i < CHART_HEIGHTS * CHART_ANGLES; i++)
        sum += (double)chart->at[i];
    return sum;
}

void bone_chart_smooth(struct bone_chart *chart)
{
    const struct bone_chart from = *chart;
    static const float weight[3] = {0.25F, 0.5F, 0.25F};
    for (int row = 0; row < CHART_HEIGHTS; row++)
        for (int column = 0; column < CHART_ANGLES; column++) {
            float sum = 0;
            for (int up = -1; up <= 1; up++)
                for (int round = -1; round <= 1 && row + up >= 0 && row + up < CHART_HEIGHTS; round++)
                    sum += weight[up + 1] * weight[round + 1] *
                           from.at[(row + up) * CHART_ANGLES + (column + round + CHART_ANGLES) % CHART_ANGLES];
            chart->at[row * CHART_ANGLES + column] = sum;
        }
}
