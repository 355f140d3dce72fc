// The median of measured values. Pure.
#pragma once
#include <stdlib.h>

static inline int median_compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// Sorts the values. Of an even count the upper of the two middle ones; 0 of none.
static inline double median_of(double *values, size_t count)
{
    qsort(values, count, sizeof *values, median_compare);
    return count ? values[count / 2] : 0;
}
