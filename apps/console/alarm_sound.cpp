#include "alarm_sound.hpp"

#include <QApplication>
#include <QDataStream>
#include <QFile>
#include <QProcess>
#include <QStandardPaths>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace atirma::console {
namespace {

constexpr int rate = 16000;

struct tone {
    double hertz, seconds;
};

std::vector<tone> tones_of(severity how) {
    switch (how) {
        case severity::critical: return {{880, 0.18}, {660, 0.18}, {880, 0.18}, {660, 0.18}, {880, 0.25}};
        case severity::warning: return {{740, 0.22}, {0, 0.08}, {740, 0.22}};
        case severity::notice: break;
    }
    return {{520, 0.2}};
}

} // namespace

QByteArray alarm_wave(severity how) {
    std::vector<qint16> samples;
    for (const auto& each : tones_of(how)) {
        int count = static_cast<int>(each.seconds * rate);
        for (int i = 0; i < count; ++i) {
            double edge = std::min({1.0, i / 160.0, (count - i) / 160.0}); // no click
            samples.push_back(
                static_cast<qint16>(20000 * edge * std::sin(2 * std::numbers::pi * each.hertz * i / rate)));
        }
    }
    QByteArray made;
    QDataStream to(&made, QIODevice::WriteOnly);
    to.setByteOrder(QDataStream::LittleEndian);
    auto bytes = static_cast<quint32>(samples.size() * 2);
    to.writeRawData("RIFF", 4);
    to << quint32(36 + bytes);
    to.writeRawData("WAVEfmt ", 8);
    to << quint32(16) << quint16(1) << quint16(1) << quint32(rate) << quint32(rate * 2) << quint16(2) << quint16(16);
    to.writeRawData("data", 4);
    to << bytes;
    for (auto one : samples) to << one;
    return made;
}

alarm_sound::alarm_sound(QString player, QObject* parent, std::chrono::milliseconds longest)
    : QObject(parent), player_(std::move(player)) {
    limit_.setSingleShot(true);
    limit_.setInterval(longest);
    connect(&limit_, &QTimer::timeout, this, [this] {
        stop();
        fall_back(tr("%1 does not end").arg(player_));
    });
    silent_ = player_ == "none";
    if (silent_ || !player_.isEmpty()) return;
    for (const char* each : {"pw-play", "paplay", "aplay"})
        if (auto found = QStandardPaths::findExecutable(each); !found.isEmpty()) {
            player_ = found;
            return;
        }
    trouble_ = tr("no program plays sounds (pw-play, paplay, aplay): only the bell rings");
}

alarm_sound::~alarm_sound() {
    if (!running_) return;
    running_->disconnect(this);
    running_->kill();
    running_->waitForFinished(500);
}

QString alarm_sound::file_of(severity how) {
    auto path = folder_.filePath(QStringLiteral("alarm-%1.wav").arg(static_cast<int>(how)));
    if (QFile::exists(path)) return path;
    QFile file(path);
    auto wave = alarm_wave(how);
    if (!file.open(QIODevice::WriteOnly) || file.write(wave) != wave.size()) return {};
    return path;
}

bool alarm_sound::playing() const { return running_ && running_->state() != QProcess::NotRunning; }

void alarm_sound::play(severity how) {
    if (silent_ || (playing() && how <= running_how_)) return;
    stop();
    if (player_.isEmpty()) return QApplication::beep();
    auto path = file_of(how);
    if (path.isEmpty()) return fall_back(tr("cannot write the sound of alarms to %1").arg(folder_.path()));
    running_ = std::make_unique<QProcess>();
    running_how_ = how;
    connect(running_.get(), &QProcess::errorOccurred, this, [this](QProcess::ProcessError why) {
        if (why != QProcess::FailedToStart) return;
        limit_.stop();
        fall_back(tr("%1 cannot be started").arg(player_));
    });
    connect(running_.get(), &QProcess::finished, this, [this](int code, QProcess::ExitStatus) {
        limit_.stop();
        if (code != 0) fall_back(tr("%1 ended with %2").arg(player_).arg(code));
    });
    running_->setStandardOutputFile(QProcess::nullDevice());
    running_->setStandardErrorFile(QProcess::nullDevice());
    limit_.start();
    running_->start(player_, {path});
}

/// Does not wait for its end: a player that hangs in a driver would hold the window.
void alarm_sound::stop() {
    limit_.stop();
    if (!playing()) return;
    auto* old = running_.release();
    old->disconnect(this);
    connect(old, &QProcess::finished, old, &QObject::deleteLater);
    connect(old, &QProcess::errorOccurred, old, &QObject::deleteLater);
    old->kill();
}

void alarm_sound::fall_back(const QString& why) {
    QApplication::beep();
    if (trouble_ == why) return;
    trouble_ = why;
    Q_EMIT failed(tr("The alarm is not heard: %1; only the bell rings").arg(why));
}

} // namespace atirma::console
