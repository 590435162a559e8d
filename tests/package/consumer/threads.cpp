// Whether the library's loops are on oneTBB.
#include <raydix/thread_pool.h>

#include <cstdio>

int main() { std::printf("oneTBB: %s\n", raydix::has_onetbb() ? "yes" : "no"); }
