// In a library, so that a test which brings its own main() is not disturbed.
namespace leadline::test {
int run_all(int argc, char** argv);
}

int main(int argc, char** argv) { return leadline::test::run_all(argc, argv); }
