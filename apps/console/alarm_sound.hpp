#pragma once
#include <components/gui_client/alarm.hpp>

#include <QObject>
#include <QString>
#include <QTemporaryDir>
#include <QTimer>

#include <chrono>
#include <memory>

class QProcess;

namespace atirma::console {

/// Plays the alarm: a program plays a sound file, and without one the system's bell rings. A sound that still plays is
/// not started again; a more severe one replaces it. A program that does not end is killed, and the bell rings.
class alarm_sound : public QObject {
    Q_OBJECT
public:
    /// `player`: a program that plays the WAV file that is its argument; empty: the first of pw-play, paplay and aplay
    /// that is installed; "none": silence.
    /// `longest`: the time that it may take. Default: 4 s.
    explicit alarm_sound(QString player, QObject* parent = nullptr,
                         std::chrono::milliseconds longest = std::chrono::seconds(4));
    ~alarm_sound() override;

    void play(severity how);
    bool playing() const;
    /// Why there is only the bell; empty: there is a player.
    const QString& trouble() const noexcept { return trouble_; }

Q_SIGNALS:
    /// It could not be played; the bell rings instead.
    void failed(const QString& why);

private:
    QString file_of(severity how);
    void fall_back(const QString& why);
    void stop();

    QString player_, trouble_;
    bool silent_ = false;
    QTemporaryDir folder_;
    std::unique_ptr<QProcess> running_;
    severity running_how_ = severity::notice;
    QTimer limit_;
};

/// A WAV file (16 bit, mono): two tones for critical, one for a warning, a short low one for a notice.
QByteArray alarm_wave(severity how);

} // namespace atirma::console
