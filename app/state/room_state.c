#include "app/state/room_state.h"

#include "base/text.h"

#include <string.h>

// Chosen by hand: at that distance, and at that standard deviation, a label has half its opacity.
static const double HALF_DISTANCE_M = 8, HALF_SIGMA_M = 0.25, GONE_SHARE = 0.5;

struct room_state room_state_start(void)
{
    return (struct room_state){.names = true,
                               .filmed = true,
                               .card = ROOM_NOTHING,
                               .wanted = ROOM_NOTHING,
                               .map_orbit = {{0, 0, 0.5}, 0.6, 0.75, 7}};
}

bool room_state_type(struct room_state *s, const char *text)
{
    return (*s->filter || *text != ' ') && text_append(s->filter, sizeof s->filter, text);
}

void room_state_want(struct room_state *s, int thing) { s->wanted = s->wanted == thing ? ROOM_NOTHING : thing; }

double room_label_opacity(double distance_m, double sigma_m, bool gone)
{
    const double far = distance_m / HALF_DISTANCE_M, doubt = sigma_m / HALF_SIGMA_M;
    const double share = 1 / (1 + far * far) / (1 + doubt * doubt);
    if (!isfinite(share))
        return 0;
    return gone ? share * GONE_SHARE : share;
}
