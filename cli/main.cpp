// The raydix program.
#include "raydix.h"

int main(int argc, char** argv) { return raydix::cli::run_raydix(argc, argv); }
