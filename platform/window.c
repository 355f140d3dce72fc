#include "platform/window.h"

#include <SDL.h>
#include <stdlib.h>

struct window {
    SDL_Window *window;
    SDL_Renderer *renderer;
    SDL_Texture *texture;
    int width, height;
};

enum status window_open(struct window **out, const char *title, int width, int height)
{
    *out = NULL;
    struct window *w = calloc(1, sizeof *w);
    if (!w)
        return fail(ERR_MEMORY, "no memory for a window");
    *w = (struct window){.width = width, .height = height};
    // Drawn without OpenGL: the thread has the painter's own EGL context current, which
    // SDL's (GLX, on X11) would push aside.
    SDL_SetHint(SDL_HINT_FRAMEBUFFER_ACCELERATION, "0");
    if (SDL_Init(SDL_INIT_VIDEO)) {
        free(w);
        return fail(ERR_DEVICE, "no window can be opened: %s; is there a display?", SDL_GetError());
    }
    w->window = SDL_CreateWindow(title, SDL_WINDOWPOS_CENTERED, SDL_WINDOWPOS_CENTERED, width, height,
                                 SDL_WINDOW_RESIZABLE | SDL_WINDOW_ALLOW_HIGHDPI);
    w->renderer = w->window ? SDL_CreateRenderer(w->window, -1, SDL_RENDERER_SOFTWARE) : NULL;
    w->texture = w->renderer ? SDL_CreateTexture(w->renderer, SDL_PIXELFORMAT_RGB24, SDL_TEXTUREACCESS_STREAMING, width,
                                                 height)
                             : NULL;
    if (!w->texture || SDL_RenderSetLogicalSize(w->renderer, width, height)) {
        enum status status = fail(ERR_DEVICE, "no window can be opened: %s", SDL_GetError());
        window_close(&w);
        return status;
    }
    *out = w;
    return OK;
}

void window_close(struct window **w)
{
    if (*w) {
        if ((*w)->texture)
            SDL_DestroyTexture((*w)->texture);
        if ((*w)->renderer)
            SDL_DestroyRenderer((*w)->renderer);
        if ((*w)->window)
            SDL_DestroyWindow((*w)->window);
        SDL_Quit();
        free(*w);
    }
    *w = NULL;
}

enum status window_show(struct window *w, const uint8_t *rgb)
{
    if (SDL_UpdateTexture(w->texture, NULL, rgb, 3 * w->width) || SDL_RenderClear(w->renderer) ||
        SDL_RenderCopy(w->renderer, w->texture, NULL, NULL))
        return fail(ERR_DEVICE, "the window cannot show a picture: %s", SDL_GetError());
    SDL_RenderPresent(w->renderer);
    return OK;
}

static void hear_key(const SDL_KeyboardEvent *key, struct window_events *events)
{
    switch (key->keysym.sym) {
    case SDLK_ESCAPE:
    case SDLK_q: events->quit = true; break;
    case SDLK_SPACE: events->play_pause ^= true; break;
    case SDLK_RIGHT: events->steps++; break;
    case SDLK_LEFT: events->steps--; break;
    default: break;
    }
}

static void hear(const struct window *w, const SDL_Event *event, struct window_events *events)
{
    switch (event->type) {
    case SDL_QUIT: events->quit = true; break;
    case SDL_KEYDOWN: hear_key(&event->key, events); break;
    case SDL_MOUSEWHEEL: events->zoom += event->wheel.y; break;
    case SDL_MULTIGESTURE: events->zoom += 20 * event->mgesture.dDist; break;
    case SDL_MOUSEMOTION: // a finger comes as a mouse, too
        if (event->motion.state & SDL_BUTTON_LMASK) {
            events->drag_x += event->motion.xrel / (double)w->width;
            events->drag_y += event->motion.yrel / (double)w->height;
        }
        break;
    default: break;
    }
}

struct window_events window_poll(struct window *w, int wait_ms)
{
    struct window_events events = {0};
    SDL_Event event;
    if (SDL_WaitEventTimeout(&event, wait_ms > 0 ? wait_ms : 1)) {
        hear(w, &event, &events);
        while (SDL_PollEvent(&event))
            hear(w, &event, &events);
    }
    return events;
}
