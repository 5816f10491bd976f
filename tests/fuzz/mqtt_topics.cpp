// link: ise_mqtt
// Any bytes as the topic of a request: a topic that is read is the one that is made again of what was read, and every
// name has a topic that is read back as the same.
#include <components/mqtt_bridge/topics.hpp>

#include <cstdint>
#include <cstdlib>
#include <string>

namespace {

void require(bool holds) {
    if (!holds) std::abort();
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace ise::mqtt;
    std::string text(reinterpret_cast<const char*>(data), size);
    auto read = read_topic("ise", "call", text);
    if (read) {
        require(!read->path.empty() && !read->service.empty());
        auto made = topic_of("ise", "call", *read);
        require(made && read_topic("ise", "call", *made)->service == read->service);
    } else {
        require(!read.error().message().empty());
    }
    if (text.empty() || text.size() > 200) return 0;
    service_place place;
    place.path = "p/" + text;
    place.service = text;
    auto made = topic_of("ise", "out", place);
    require(made && made->find_first_of("+#") == std::string::npos);
    auto back = read_topic("ise", "out", *made);
    require(back && back->path == place.path && back->service == place.service);
    if (check_prefix(text)) require(topic_of(text, "out", place).has_value());
    return 0;
}
