#include "compare/findings.h"

#include "compare/findings_internal.h"

#include <stdlib.h>

static int worst_first(const void *a, const void *b)
{
    const struct finding *x = a, *y = b;
    if (x->weight != y->weight)
        return x->weight < y->weight ? 1 : -1;
    return (x->from_s > y->from_s) - (x->from_s < y->from_s);
}

enum status findings_make(struct comparison *c)
{
    enum status status = find_pieces(c);
    if (status == OK)
        status = find_postures(c);
    if (status == OK && c->finding_count > 1)
        qsort(c->findings, (size_t)c->finding_count, sizeof *c->findings, worst_first);
    return status;
}
