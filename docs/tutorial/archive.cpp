#include <ise/packet/archive.hpp>

#include <cereal/archives/json.hpp>

#include <iostream>
#include <sstream>

struct fix {
    double latitude_deg = 0;
    double longitude_deg = 0;
    float speed_kn = 0;
};

int main() {
    fix at{28.1, -15.45, 2.5f};
    std::stringstream file;
    cereal::JSONOutputArchive{file}(at);

    fix read;
    cereal::JSONInputArchive{file}(read);
    std::cout << file.str() << '\n' << read.speed_kn << " kn\n";
}
