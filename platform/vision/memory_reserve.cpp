#include "platform/vision/memory_reserve.hpp"

#include <cstdlib>
#include <mutex>
#include <new>

namespace
{

std::mutex lock; // guards the two below, and what each reserve has kept
memory_reserve *newest = nullptr;
std::new_handler earlier = nullptr; // before the first of those that live

} // namespace

// The handler of operator new, which tries again when this returns.
void memory_reserve::give_back()
{
    const std::lock_guard<std::mutex> guard(lock);
    memory_reserve *r = newest;
    while (r && !r->kept)
        r = r->older;
    if (!r)
        throw std::bad_alloc();
    std::free(r->kept);
    r->kept = nullptr;
}

memory_reserve::memory_reserve(size_t bytes) : kept(std::malloc(bytes)), older(nullptr)
{
    if (!kept)
        throw std::bad_alloc();
    const std::lock_guard<std::mutex> guard(lock);
    if (!newest)
        earlier = std::set_new_handler(give_back);
    older = newest;
    newest = this;
}

memory_reserve::~memory_reserve()
{
    const std::lock_guard<std::mutex> guard(lock);
    memory_reserve **link = &newest;
    while (*link != this)
        link = &(*link)->older;
    *link = older;
    std::free(kept);
    if (!newest)
        std::set_new_handler(earlier);
}

bool memory_reserve::is_used() const
{
    const std::lock_guard<std::mutex> guard(lock);
    return !kept;
}
