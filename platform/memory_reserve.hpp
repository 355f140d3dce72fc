// Memory that is kept back for a library whose answer to a failing operator new is to end the program. While one of
// these lives, an operator new that fails is given what was kept back and tries again; where that is not enough, it
// throws std::bad_alloc as ever. Any thread may make one; all that live share one reserve.
#pragma once
#include <cstddef>

class memory_reserve
{
  public:
    explicit memory_reserve(size_t bytes); // throws std::bad_alloc
    ~memory_reserve();
    memory_reserve(const memory_reserve &) = delete;
    memory_reserve &operator=(const memory_reserve &) = delete;

    bool is_used() const; // then there is no memory: end soon
};
