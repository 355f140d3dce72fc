#include "app/finder.h"

#include <stdlib.h>

struct finder {
    struct locator *locator;
};

enum status finder_open(struct finder **out, const struct place *place, const struct lens *lens)
{
    *out = NULL;
    struct finder *f = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "out of memory");
    struct locator_options how = locator_default_options();
    enum status status = locator_open(&f->locator, place, lens, &how);
    if (status != OK) {
        finder_close(&f);
        return status;
    }
    *out = f;
    return OK;
}

void finder_close(struct finder **f)
{
    if (*f) {
        locator_close(&(*f)->locator);
        free(*f);
    }
    *f = NULL;
}

enum status finder_find(struct finder *f, const uint8_t *color, int64_t time_ns, struct pose *world_from_camera)
{
    (void)time_ns; // for those that remember
    struct location location;
    enum status status = locator_find(f->locator, color, NULL, &location);
    if (status == ERR_SOLVER)
        return NOTHING; // it gave up on this picture, no more
    if (status == OK || status == AMBIGUOUS)
        *world_from_camera = location.world_from_camera;
    return status;
}
