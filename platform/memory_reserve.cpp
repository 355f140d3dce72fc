#include "platform/memory_reserve.hpp"

#include <atomic>
#include <cstdlib>
#include <mutex>
#include <new>

namespace
{

std::atomic<void *> kept(nullptr);
std::mutex lock; // guards the two below
int living = 0;
std::new_handler earlier = nullptr;

// The handler of operator new, which tries again when this returns.
void give_back()
{
    void *memory = kept.exchange(nullptr);
    if (!memory)
        throw std::bad_alloc();
    std::free(memory);
}

} // namespace

memory_reserve::memory_reserve(size_t bytes)
{
    const std::lock_guard<std::mutex> guard(lock);
    if (!kept.load()) {
        void *memory = std::malloc(bytes);
        if (!memory)
            throw std::bad_alloc();
        kept.store(memory);
    }
    if (living++ == 0)
        earlier = std::set_new_handler(give_back);
}

memory_reserve::~memory_reserve()
{
    const std::lock_guard<std::mutex> guard(lock);
    if (--living > 0)
        return;
    std::set_new_handler(earlier);
    std::free(kept.exchange(nullptr));
}

bool memory_reserve::is_used() const { return !kept.load(); }
