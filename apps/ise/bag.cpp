// ise bag: what recordings have, and parts, unions and repairs of them.
#include "json.hpp"
#include "options.hpp"
#include "text.hpp"

#include <ise/bag/reader.hpp>
#include <ise/bag/recording.hpp>
#include <ise/bag/recover.hpp>
#include <ise/bag/writer.hpp>
#include <ise/core/time_text.hpp>
#include <ise/packet/codec.hpp>
#include <ise/packet/detail/text_forms.hpp>
#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <tuple>
#include <utility>

namespace ise::cli {
namespace {

struct bag_options {
    std::string act;
    std::vector<std::string> files;
    std::string out;
    std::vector<std::string> only;
    std::optional<duration> from, until; ///< since the first message
    bool stamps = false;
};

using bag::timestamp;

wall_time wall_of(timestamp at) {
    constexpr auto most = static_cast<timestamp>(std::numeric_limits<std::int64_t>::max());
    return wall_time(std::chrono::nanoseconds(static_cast<std::int64_t>(std::min(at, most))));
}

struct opened {
    std::unique_ptr<bag::source> file;
    bag::summary about;
};

opened open(const std::string& path, bag::depth how = bag::depth::index) {
    opened made;
    made.file = bag::open_file(path).value();
    made.about = bag::read_summary(*made.file, how).value();
    return made;
}

// A new file, which must not exist yet, and is removed again unless it becomes whole.
class new_file {
public:
    explicit new_file(const std::string& path) : path_(path), writer_(make(path)) {}
    new_file(const new_file&) = delete;
    new_file& operator=(const new_file&) = delete;
    ~new_file() {
        if (!whole_) std::remove(path_.c_str());
    }
    bag::writer& writer() noexcept { return writer_; }
    void keep() noexcept { whole_ = true; }

private:
    static bag::writer make(const std::string& path) {
        bag::writer_options how;
        how.library = "ise " ISE_VERSION;
        auto file = bag::create_file(path).value();
        auto made = bag::writer::make(std::move(file), how);
        if (!made) std::remove(path.c_str());
        return std::move(made).value();
    }
    std::string path_;
    bag::writer writer_;
    bool whole_ = false;
};

// "atirma/boat/position", or with everything below: "atirma/boat".
bool chosen(const bag_options& options, const std::string& topic) {
    return options.only.empty() || std::ranges::any_of(options.only, [&](const auto& one) {
               return topic == one || topic.starts_with(one + "/");
           });
}

bag::message_filter filter_of(const bag_options& options, const bag::summary& about) {
    bag::message_filter made;
    auto start = about.statistics.message_start_time;
    auto at = [&](duration after) {
        auto count = static_cast<timestamp>(after.count());
        return count > std::numeric_limits<timestamp>::max() - start ? std::numeric_limits<timestamp>::max()
                                                                     : start + count;
    };
    if (options.from) made.from = at(*options.from);
    if (options.until) made.until = at(*options.until);
    made.wanted = [options](const bag::channel_record& channel) { return chosen(options, channel.topic); };
    return made;
}

void refuse_unknown_topics(const bag_options& options, const std::string& path, const bag::summary& about) {
    for (const auto& one : options.only) {
        bag_options single;
        single.only = {one};
        if (std::ranges::any_of(about.channels,
                                [&](const auto& channel) { return chosen(single, channel.second.topic); }))
            continue;
        std::vector<std::string> known;
        for (const auto& [id, channel] : about.channels) known.push_back(channel.topic);
        auto near = nearest(one, known);
        throw problem(exit_code::usage, "usage",
                      fmt::format("{} has no topic '{}'{}", path, printable(one),
                                  near.empty() ? "" : fmt::format(", did you mean '{}'?", printable(near.front()))),
                      "ise bag info lists them");
    }
}

bool selects(const bag_options& options) { return options.from || options.until || !options.only.empty(); }

// The times and topics that were given choose no message of that file.
problem nothing_selected(const bag_options& options, const std::string& path, const bag::summary& about) {
    auto text = printable(path) + " has no message";
    if (!options.only.empty()) text += " of " + printable(enumerate(options.only));
    if (options.from && options.until)
        text += fmt::format(" between {} and {} after its first one", show_duration(*options.from),
                            show_duration(*options.until));
    else if (options.from) text += fmt::format(" from {} after its first one on", show_duration(*options.from));
    else if (options.until) text += fmt::format(" before {} after its first one", show_duration(*options.until));
    if (const auto& in = about.statistics; in.message_count > 0) {
        auto begin = wall_of(in.message_start_time), end = wall_of(in.message_end_time);
        text += fmt::format(": it lasts {}, from {} to {}", show_duration(end - begin), iso_8601(begin, 3),
                            iso_8601(end, 3));
    }
    return {exit_code::usage, "usage", text, "ise bag info shows its topics and times"};
}

// --- info and check --------------------------------------------------------------------------------------------------

struct topic_line {
    std::string topic, content, schema;
    std::uint64_t messages = 0;
};
struct gap_line {
    std::string topic, reason;
    std::optional<std::uint64_t> lost; ///< null: some of the gaps are of unknown length
    std::uint64_t gaps = 0;
};
struct attachment_line {
    std::string name, media_type;
    std::uint64_t bytes = 0;
};
struct bag_answer {
    std::string file, library, profile;
    bool complete = false;
    std::uint64_t bytes = 0, messages = 0, chunks = 0;
    std::optional<std::string> start, end;
    duration length_s{};
    std::vector<topic_line> topics;
    std::vector<gap_line> gaps;
    std::vector<attachment_line> attachments;
    std::map<std::string, std::string> metadata;
    if_any<std::string> damage;
    if_any<std::uint64_t> good_bytes;
};

std::string content_of(const bag::channel_record& channel) {
    auto found = channel.metadata.find("ise.content");
    return found == channel.metadata.end() ? channel.message_encoding : found->second;
}

std::vector<gap_line> gaps_of(bag::source& from, const bag::summary& about) {
    std::map<std::pair<std::string, std::string>, gap_line> all;
    const auto topic = std::string("ise/") + bag::gaps_topic;
    bag::message_filter which;
    which.wanted = [&](const bag::channel_record& channel) { return channel.topic == topic; };
    bool any = std::ranges::any_of(about.channels, [&](const auto& one) { return one.second.topic == topic; });
    if (!any) return {};
    bag::protobuf_type type(schema_of<bag::gap_event>());
    bag::message_reader in(from, about, std::move(which));
    for (;;) {
        auto got = in.next();
        if (!got || !*got) break; // the damage is reported apart
        auto raw = type.decode((*got)->data);
        if (!raw) continue;
        bag::gap_event event;
        try {
            event = decode<bag::gap_event>(*raw);
        } catch (const error&) {
            continue;
        }
        auto name = event.service.empty() ? event.component : event.component + "/" + event.service;
        auto& line = all[{name, event.reason}];
        if (line.gaps++ == 0) line.lost = 0;
        line.topic = name;
        line.reason = event.reason;
        if (!event.lost) line.lost.reset();
        else if (line.lost) *line.lost += *event.lost;
    }
    std::vector<gap_line> made;
    for (auto& [key, one] : all) made.push_back(std::move(one));
    return made;
}

bag_answer describe(const std::string& path, bag::depth how) {
    auto [file, about] = open(path, how);
    bag_answer made;
    made.file = path;
    made.library = about.header.library;
    made.profile = about.header.profile;
    made.complete = about.complete;
    made.bytes = about.file_bytes;
    made.messages = about.statistics.message_count;
    made.chunks = about.statistics.chunk_count;
    if (made.messages > 0) {
        made.start = iso_8601(wall_of(about.statistics.message_start_time));
        made.end = iso_8601(wall_of(about.statistics.message_end_time));
        made.length_s = wall_of(about.statistics.message_end_time) - wall_of(about.statistics.message_start_time);
    }
    for (const auto& [id, channel] : about.channels) {
        topic_line line;
        line.topic = channel.topic;
        line.content = content_of(channel);
        if (auto schema = about.schemas.find(channel.schema_id); schema != about.schemas.end())
            line.schema = schema->second.name;
        auto count = about.statistics.channel_message_counts.find(id);
        if (count != about.statistics.channel_message_counts.end()) line.messages = count->second;
        made.topics.push_back(std::move(line));
    }
    std::ranges::sort(made.topics, {}, &topic_line::topic);
    made.gaps = gaps_of(*file, about);
    for (const auto& one : about.attachments) made.attachments.push_back({one.name, one.media_type, one.data_size});
    for (const auto& one : about.metadata)
        if (auto got = bag::read_metadata(*file, one))
            for (const auto& [key, value] : got->metadata) made.metadata[one.name + "." + key] = value;
    if (about.damage) {
        made.damage = about.damage->message();
        made.good_bytes = about.good_bytes;
    }
    return made;
}

std::string as_text(const bag_answer& of) {
    auto text = fmt::format("{}: {}, {} messages in {} chunks, {}\n", printable(of.file), show_bytes(of.bytes),
                            of.messages, of.chunks, printable(of.library));
    if (of.start) text += fmt::format("  {} to {} ({})\n", *of.start, *of.end, show_duration(of.length_s));
    std::size_t width = 0;
    for (const auto& one : of.topics) width = std::max(width, columns(printable(one.topic)));
    for (const auto& one : of.topics) {
        auto name = printable(one.topic);
        text += fmt::format("  {}{}  {:>10} {:<8} {}\n", name, std::string(width - columns(name), ' '), one.messages,
                            printable(one.content), printable(one.schema));
    }
    for (const auto& one : of.attachments)
        text += fmt::format("  attached: {} ({}, {})\n", printable(one.name), printable(one.media_type),
                            show_bytes(one.bytes));
    for (const auto& [key, value] : of.metadata) text += fmt::format("  {} = {}\n", printable(key), printable(value));
    for (const auto& one : of.gaps)
        text += fmt::format("  gap: {}: {} packets in {} gap{}: {}\n", printable(one.topic),
                            one.lost ? std::to_string(*one.lost) : "an unknown number of", one.gaps,
                            one.gaps == 1 ? "" : "s", printable(one.reason));
    if (of.damage) text += fmt::format("  damaged: {}\n", printable(*of.damage));
    else if (!of.complete) text += "  it was not closed: ise bag recover\n";
    return text;
}

// --- cat -------------------------------------------------------------------------------------------------------------

// How the messages of a channel become JSON.
class shown_channel {
public:
    explicit shown_channel(const bag::channel_record& channel) : name_(channel.topic) {
        if (channel.message_encoding == "json") json_ = true;
        else if (auto made = bag::topic::of(channel)) topic_.emplace(std::move(*made));
    }
    // Null where it is not known how.
    std::string text(const bag::message_record& message, bool stamps) const {
        std::string value = "null";
        std::string extra;
        if (json_) {
            value = readable_json(ise::as_text(message.data));
        } else if (topic_) {
            auto raw = topic_->packet().decode(message.data);
            if (!raw) throw problem(raw.error());
            value = ise::to_json(topic_->packet().of(), *raw);
        } else {
            extra = fmt::format(",\"bytes\":{}", message.data.size());
        }
        std::string topic;
        ise::detail::append_json_string(topic, name_);
        if (stamps)
            extra += fmt::format(",\"log_time\":\"{}\",\"publish_time\":\"{}\",\"sequence\":{}", message.log_time,
                                 message.publish_time, message.sequence);
        return fmt::format("{{\"topic\":{},\"packet\":{}{}}}\n", topic, value, extra);
    }

private:
    std::string name_;
    bool json_ = false;
    std::optional<bag::topic> topic_;
};

task<> cat(context& in, bag_options options) {
    struct reading {
        opened file;
        std::optional<bag::message_reader> messages;
        std::map<std::uint16_t, shown_channel> channels;
    };
    for (const auto& path : options.files) {
        auto from = std::make_shared<reading>();
        auto begin = [from, &options, &path] {
            from->file = open(path);
            refuse_unknown_topics(options, path, from->file.about);
            from->messages.emplace(*from->file.file, from->file.about, filter_of(options, from->file.about));
        };
        co_await in.self.offload(begin);
        bool any = false;
        for (;;) {
            auto read = [from, &options] {
                constexpr std::size_t batch = std::size_t{64} << 10;
                std::string text;
                while (text.size() < batch) {
                    auto got = from->messages->next().value();
                    if (!got) break;
                    const auto& channel = from->file.about.channels.at(got->channel_id);
                    auto& shown = from->channels.try_emplace(got->channel_id, channel).first->second;
                    text += shown.text(*got, options.stamps);
                }
                return text;
            };
            auto text = co_await in.self.offload(read);
            if (text.empty()) break;
            any = true;
            co_await in.out.write(in.self, std::move(text));
        }
        if (from->file.about.damage)
            throw problem(exit_code::failed, "malformed", from->file.about.damage->message(),
                          "what comes before was shown; ise bag recover makes a whole file of it");
        if (!any && selects(options)) throw nothing_selected(options, path, from->file.about);
    }
}

// --- cut and merge ---------------------------------------------------------------------------------------------------

// Channels of several files in one: equal ones become one.
class joined_channels {
public:
    explicit joined_channels(bag::writer& to) : to_(to) {}
    std::uint16_t channel(std::size_t file, const bag::summary& about, std::uint16_t id) {
        auto known = ids_.find({file, id});
        if (known != ids_.end()) return known->second;
        const auto& channel = about.channels.at(id);
        std::uint16_t schema = 0;
        if (auto of = about.schemas.find(channel.schema_id); of != about.schemas.end())
            schema = to_.add_schema(of->second.name, of->second.encoding, of->second.data).value();
        auto key = std::tuple(schema, channel.topic, channel.message_encoding, channel.metadata);
        auto& made = made_[key];
        if (!made) made = to_.add_channel(schema, channel.topic, channel.message_encoding, channel.metadata).value();
        return ids_[{file, id}] = *made;
    }

private:
    bag::writer& to_;
    std::map<std::pair<std::size_t, std::uint16_t>, std::uint16_t> ids_;
    std::map<std::tuple<std::uint16_t, std::string, std::string, bag::string_map>, std::optional<std::uint16_t>> made_;
};

struct copy_answer {
    std::string file;
    std::uint64_t messages = 0, bytes = 0;
};

// The messages of all files by time, with their attachments and metadata.
copy_answer copy(const bag_options& options) {
    struct input {
        opened file;
        std::unique_ptr<bag::message_reader> messages;
        std::optional<bag::message_record> next;
    };
    std::vector<input> all;
    for (const auto& path : options.files) {
        input one;
        one.file = open(path);
        if (one.file.about.damage)
            throw problem(exit_code::failed, "malformed", one.file.about.damage->message(),
                          "ise bag recover makes a whole file of what there is");
        all.push_back(std::move(one));
    }
    for (std::size_t i = 0; i < all.size(); ++i) refuse_unknown_topics(options, options.files[i], all[i].file.about);
    new_file made(options.out);
    auto& out = made.writer();
    joined_channels channels(out);
    for (auto& one : all) {
        for (const auto& where : one.file.about.metadata)
            out.write(bag::read_metadata(*one.file.file, where).value()).value();
        for (const auto& where : one.file.about.attachments) {
            auto got = bag::read_attachment(*one.file.file, where).value();
            bag::attachment_record attached;
            attached.log_time = got.log_time;
            attached.create_time = got.create_time;
            attached.name = got.name;
            attached.media_type = got.media_type;
            attached.data = got.data;
            out.attach(attached).value();
        }
        one.messages =
            std::make_unique<bag::message_reader>(*one.file.file, one.file.about, filter_of(options, one.file.about));
        one.next = one.messages->next().value();
    }
    copy_answer answer;
    answer.file = options.out;
    for (;;) {
        std::size_t first = all.size();
        for (std::size_t i = 0; i < all.size(); ++i)
            if (all[i].next && (first == all.size() || all[i].next->log_time < all[first].next->log_time)) first = i;
        if (first == all.size()) break;
        auto message = *all[first].next;
        message.channel_id = channels.channel(first, all[first].file.about, message.channel_id);
        out.write(message).value();
        ++answer.messages;
        all[first].next = all[first].messages->next().value();
    }
    if (answer.messages == 0 && selects(options))
        throw nothing_selected(options, options.files.front(), all.front().file.about);
    out.close().value();
    made.keep();
    answer.bytes = out.bytes_written();
    return answer;
}

// --- recover ---------------------------------------------------------------------------------------------------------

struct recover_answer {
    std::string file;
    bool was_complete = false;
    std::uint64_t messages = 0, bytes = 0, left_out = 0;
    if_any<std::string> cut;
    std::vector<std::string> damaged_chunks;
};

recover_answer recover_file(const std::string& path, const std::string& to) {
    auto from = bag::open_file(path).value();
    bag::record_reader head(*from);
    if (auto first = head.next(); !first && head.offset() == 0) throw problem(first.error()); // before a file is made
    new_file made(to);
    auto& out = made.writer();
    auto got = bag::recover(*from, out).value();
    made.keep();
    recover_answer answer;
    answer.file = to;
    answer.was_complete = got.complete;
    answer.messages = got.messages;
    answer.left_out = got.left_out;
    answer.bytes = out.bytes_written();
    if (got.end) answer.cut = got.end->message();
    for (const auto& one : got.damaged_chunks) answer.damaged_chunks.push_back(one.message());
    return answer;
}

std::string as_text(const recover_answer& of) {
    auto text = fmt::format("{}: {} messages, {}{}\n", printable(of.file), of.messages, show_bytes(of.bytes),
                            of.was_complete ? " (nothing was damaged)" : "");
    if (of.cut) text += fmt::format("  {}\n", printable(*of.cut));
    for (const auto& one : of.damaged_chunks) text += fmt::format("  skipped: {}\n", printable(one));
    if (of.left_out > 0)
        text +=
            fmt::format("  left out: {} messages, since what they are was described in a damaged part\n", of.left_out);
    return text;
}

// --- the command -----------------------------------------------------------------------------------------------------

task<> bag_work(context& in, bag_options options) {
    if (options.act == "cat") {
        co_await cat(in, options);
        co_return;
    }
    if (options.act == "info" || options.act == "check") {
        std::string damaged;
        for (const auto& path : options.files) {
            auto how = options.act == "check" ? bag::depth::whole : bag::depth::index;
            auto look = [&path, how] { return describe(path, how); };
            auto answer = co_await in.self.offload(look);
            auto text = in.set.json ? json_line(answer) : as_text(answer);
            if (options.act == "check" && !in.set.json && answer.complete && !answer.damage)
                text += "  every byte was read: nothing is damaged\n";
            if (answer.damage && damaged.empty()) damaged = *answer.damage;
            co_await in.out.write(in.self, std::move(text));
        }
        if (!damaged.empty() && options.act == "check")
            throw problem(exit_code::failed, "malformed", damaged, "ise bag recover FILE --out FILE");
        co_return;
    }
    if (options.act == "recover") {
        auto mend = [&options] { return recover_file(options.files.front(), options.out); };
        auto answer = co_await in.self.offload(mend);
        auto text = in.set.json ? json_line(answer) : as_text(answer);
        co_await in.out.write(in.self, std::move(text));
        co_return;
    }
    auto work = [&options] { return copy(options); };
    auto answer = co_await in.self.offload(work);
    auto text = in.set.json ? json_line(answer)
                            : fmt::format("{}: {} messages, {}\n", printable(answer.file), answer.messages,
                                          show_bytes(answer.bytes));
    co_await in.out.write(in.self, std::move(text));
}

void declare_bag(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<bag_options>();
    app.add_option("ACTION", given->act,
                   "info: what it has; cat: its packets as JSON; check: every byte; cut: a part of it; merge: several "
                   "by time; recover: what there is of one that was cut or damaged")
        ->required()
        ->check(one_of({"cat", "check", "cut", "info", "merge", "recover"}));
    app.add_option("FILE", given->files, "recordings")->required();
    app.add_option("-o,--out", given->out, "of cut, merge, recover: the new file")->type_name("FILE");
    add_each(app, "--only", given->only, "of cat, cut, merge: this topic or those below it; may be given several times",
             "TOPIC");
    add_time(app, "--from", given->from, "of cat, cut: from this time after the first message");
    add_time(app, "--until", given->until, "of cat, cut: until this time after the first message");
    app.add_flag("--stamps", given->stamps, "of cat: times and numbers too");
    app.callback([&made, given] {
        bool writes = given->act == "cut" || given->act == "merge" || given->act == "recover";
        if (writes == given->out.empty())
            throw problem(exit_code::usage, "usage",
                          writes ? fmt::format("'bag {}' requires --out: the new file", given->act)
                                 : fmt::format("'bag {}' writes no file: it does not accept --out", given->act));
        const bool parts = given->act == "cat" || given->act == "cut";
        if (!parts && (given->from || given->until))
            throw problem(
                exit_code::usage, "usage",
                fmt::format("'bag {}' does not accept --from and --until: ise bag cut makes a part", given->act));
        if (!parts && given->act != "merge" && !given->only.empty())
            throw problem(exit_code::usage, "usage", fmt::format("'bag {}' does not accept --only", given->act));
        if (given->from && given->until && *given->from >= *given->until)
            throw problem(exit_code::usage, "usage", "--from is not before --until: nothing is between them");
        if (given->files.size() > 1 && (given->act == "cut" || given->act == "recover"))
            throw problem(exit_code::usage, "usage", fmt::format("'bag {}' requires one file", given->act),
                          "ise bag merge makes one of several");
        made.work = [given](context& in) { return bag_work(in, *given); };
    });
}

} // namespace

extern const command bag_command{"bag", record_group, "shows, checks, cuts, merges and recovers recordings",
                                 "  ise bag info voyage.mcap\n"
                                 "  ise bag cat voyage.mcap --only atirma/boat/position --from 10min\n"
                                 "  ise bag recover voyage.mcap --out whole.mcap\n",
                                 declare_bag};

} // namespace ise::cli
