// Memory that is kept back for a library whose answer to a failing operator new is to end the program. While one of
// these lives, an operator new that fails is given what was kept back and tries again; where that is not enough, it
// throws std::bad_alloc as ever. Any thread may make one, of its own size; what an operator gets is the newest that is
// left of all that live, whoever made it.
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

  private:
    static void give_back();

    void *kept;
    memory_reserve *older;
};
