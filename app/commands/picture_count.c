#include "app/commands/picture_count.h"

#include "platform/files/json.h"

#include <stdio.h>
#include <string.h>

int64_t picture_count_all(const struct picture_count *c)
{
    return c->placed + c->ambiguous + c->not_placed + c->unreadable;
}

bool picture_count_is_few(const struct picture_count *c)
{
    return 2 * c->placed < c->placed + c->ambiguous + c->not_placed;
}

void picture_count_add(struct picture_count *c, enum status found)
{
    c->placed += found == OK;
    c->ambiguous += found == AMBIGUOUS;
    c->not_placed += found != OK && found != AMBIGUOUS;
}

const char *picture_count_text(const struct picture_count *c, char out[PICTURE_COUNT_BYTES])
{
    const struct {
        int64_t count;
        const char *what;
    } others[] = {
        {c->ambiguous, "ambiguous"}, {c->not_placed, "not placed"}, {c->unreadable, "unreadable or of another size"}};
    const long long all = picture_count_all(c);
    snprintf(out, PICTURE_COUNT_BYTES, "%lld of %lld pictures placed", (long long)c->placed, all);
    for (size_t k = 0; k < COUNT_OF(others); k++)
        if (others[k].count) {
            const size_t used = strlen(out);
            snprintf(out + used, PICTURE_COUNT_BYTES - used, ", %lld %s", (long long)others[k].count, others[k].what);
        }
    return out;
}

void picture_count_add_json(struct json *object, const struct picture_count *c)
{
    json_add_number(object, "pictures", (double)picture_count_all(c));
    json_add_number(object, "placed", (double)c->placed);
    json_add_number(object, "ambiguous", (double)c->ambiguous);
    json_add_number(object, "not_placed", (double)c->not_placed);
    json_add_number(object, "damaged", (double)c->unreadable);
}
