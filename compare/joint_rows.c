#include "compare/joint_rows.h"

#include <stdlib.h>
#include <string.h>

enum status joint_rows_add(struct joint_rows *r, const struct joint_row *row)
{
    if (r->count == r->capacity) {
        const int64_t capacity = r->capacity ? 2 * r->capacity : 4096;
        struct joint_row *at = realloc(r->at, (size_t)capacity * sizeof *at);
        if (!at)
            return fail(ERR_MEMORY, "no memory for a movement's joints");
        r->at = at;
        r->capacity = capacity;
    }
    r->at[r->count++] = *row;
    return OK;
}

void joint_rows_free(struct joint_rows *r)
{
    free(r->at);
    *r = (struct joint_rows){0};
}

int64_t joint_rows_group(const struct joint_rows *r, int64_t first)
{
    int64_t end = first + 1;
    while (end < r->count && !(r->at[end].time < r->at[first].time) && !(r->at[end].time > r->at[first].time))
        end++;
    return end;
}

// ------------------------------------------------------------- order

static int by_time_and_joint(const void *a, const void *b)
{
    const struct joint_row *x = a, *y = b;
    if (x->time < y->time || x->time > y->time)
        return x->time < y->time ? -1 : 1;
    return x->joint - y->joint;
}

enum status joint_rows_sort(struct joint_rows *r, struct joint_notes *notes)
{
    int64_t times = 0, back = 0, sorted_times = 0;
    for (int64_t i = 0; i < r->count; i = joint_rows_group(r, i), times++)
        back += i && r->at[i].time < r->at[i - 1].time;
    if (!back)
        return OK;
    const size_t bytes = (size_t)r->count * sizeof *r->at;
    struct joint_row *sorted = malloc(bytes);
    if (!sorted)
        return fail(ERR_MEMORY, "no memory to sort a movement's joints");
    memcpy(sorted, r->at, bytes);
    qsort(sorted, (size_t)r->count, sizeof *sorted, by_time_and_joint);
    bool twice = false;
    for (int64_t i = 0; i < r->count; i++) {
        const bool same_time = i && !(sorted[i].time > sorted[i - 1].time);
        twice = twice || (same_time && sorted[i].joint == sorted[i - 1].joint);
        sorted_times += !same_time;
    }
    // Few steps back to times that are not the same again are a clock's. By hand: a quarter, a half.
    if (!twice && (4 * back > times || 2 * sorted_times <= times)) {
        memcpy(r->at, sorted, bytes);
        joint_note(notes, "the rows are not in the order of time; they were sorted");
    }
    free(sorted);
    return OK;
}

// ------------------------------------------------------------- holes

static bool is_zero(const struct joint_row *row)
{
    return !(fabs(row->place.x) > 0) && !(fabs(row->place.y) > 0) && !(fabs(row->place.z) > 0);
}

void joint_rows_drop_zeros(struct joint_rows *r, struct joint_notes *notes)
{
    int64_t all[JOINT_COUNT] = {0}, zero[JOINT_COUNT] = {0}, dropped = 0, kept = 0, zeros = 0;
    for (int64_t i = 0; i < r->count; i++) {
        all[r->at[i].joint]++;
        zero[r->at[i].joint] += is_zero(&r->at[i]);
        zeros += is_zero(&r->at[i]);
    }
    int origin = -1;
    for (int j = JOINT_TORSO; j <= JOINT_WAIST; j++)
        if (all[j] && zero[j] == all[j] && zeros == zero[j])
            origin = j;
    if (origin >= 0)
        return;
    for (int64_t i = 0; i < r->count; i++) {
        if (is_zero(&r->at[i]))
            dropped++;
        else
            r->at[kept++] = r->at[i];
    }
    r->count = kept;
    if (dropped)
        joint_note(notes, "%lld joints lie at 0, 0, 0 exactly; they were taken as not seen", (long long)dropped);
}
